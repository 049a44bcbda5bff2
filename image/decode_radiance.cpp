#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <memory>

#include "core/error.h"
#include "image/stored_picture.h"

void hpr_decode_radiance(std::span<const std::byte> bytes, const std::string& name, const hpr::ImageLimits& limits,
                         hpr::FloatImage& image) {
  OIIO::attribute("threads", 1);
  OIIO::Filesystem::IOMemReader memory(const_cast<std::byte*>(bytes.data()), bytes.size());
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create("hdr", false, nullptr, &memory);
  if (!input) {
    throw hpr::Error(hpr::ExitCode::Internal, "OpenImageIO cannot read hdr", "reinstall libopenimageio2.4");
  }
  // open() by itself takes the file of that name: the memory must be named to it here, not only at create().
  input->set_ioproxy(&memory);
  OIIO::ImageSpec spec;
  if (!input->open(name, spec)) hpr::throw_undecodable(name, input->geterror());
  const auto count = [](int value) { return static_cast<std::uint64_t>(std::max(value, 0)); };
  hpr::check_header(count(spec.width), count(spec.height), count(spec.nchannels), name, limits);
  image = {.size = {spec.width, spec.height}, .channels = spec.channelnames, .values = {}, .linear = true};
  image.values.resize(image.size.area() * image.channels.size());
  if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT, image.values.data()) || input->has_error()) {
    hpr::throw_undecodable(name, input->geterror());
  }
}
