#include <webp/decode.h>

#include "core/error.h"
#include "image/stored_picture.h"

namespace hpr {
namespace {

const char* problem_of(VP8StatusCode status) {
  switch (status) {
    case VP8_STATUS_NOT_ENOUGH_DATA:
      return "it ends too early";
    case VP8_STATUS_UNSUPPORTED_FEATURE:
      return "it uses what libwebp does not know";
    case VP8_STATUS_OUT_OF_MEMORY:
      return "the memory does not suffice";
    default:
      return "its data are broken";
  }
}

}  // namespace

StoredPicture decode_webp(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits) {
  WebPDecoderConfig config;
  if (WebPInitDecoderConfig(&config) == 0)
    throw Error(ExitCode::Internal, "libwebp is of another version than its header");
  const auto* const data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  const VP8StatusCode known = WebPGetFeatures(data, bytes.size(), &config.input);
  if (known != VP8_STATUS_OK) throw_undecodable(name, problem_of(known));
  if (config.input.has_animation != 0) throw_undecodable(name, "it is an animation");
  const std::size_t channels = config.input.has_alpha != 0 ? 4 : 3;
  check_header(static_cast<std::uint64_t>(config.input.width), static_cast<std::uint64_t>(config.input.height),
               channels, name, limits);
  StoredPicture picture{
      .size = {config.input.width, config.input.height}, .channels = channels, .bytes = {}, .deep = false};
  picture.bytes.resize(picture.size.area() * channels);
  config.output.colorspace = channels == 4 ? MODE_RGBA : MODE_RGB;
  config.output.is_external_memory = 1;
  config.output.u.RGBA = {picture.bytes.data(), config.input.width * static_cast<int>(channels), picture.bytes.size()};
  const VP8StatusCode decoded = WebPDecode(data, bytes.size(), &config);
  if (decoded != VP8_STATUS_OK) throw_undecodable(name, problem_of(decoded));
  return picture;
}

}  // namespace hpr
