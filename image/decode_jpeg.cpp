#include <array>
#include <csetjmp>
#include <cstddef>
#include <cstdio>
// jpeglib.h needs both of the above and does not include them.
#include <jpeglib.h>

#include "core/error.h"
#include "image/stored_picture.h"

namespace hpr {
namespace {

constexpr std::uint32_t kInks = 4;  ///< of a picture for print

/// Reads one file by libjpeg, which reports errors through function pointers: ours go back by longjmp(), so no function
/// that sets its target has a variable with a destructor. A warning is an error: what follows it is made up.
class JpegReader {
 public:
  explicit JpegReader(std::span<const std::byte> bytes) : bytes_(bytes) {
    jpeg_.err = jpeg_std_error(&errors_);
    errors_.error_exit = [](j_common_ptr jpeg) { self(jpeg)->give_up(); };
    errors_.emit_message = [](j_common_ptr jpeg, int level) {
      if (level < 0) self(jpeg)->give_up();
    };
    jpeg_.client_data = this;
    progress_.progress_monitor = [](j_common_ptr jpeg) { self(jpeg)->count_scans(); };
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  [[nodiscard]] const char* problem() const { return problem_.data(); }

  /// Up to the first pixel. False with problem().
  bool read_header() {
    if (setjmp(failed_) != 0) return false;
    jpeg_create_decompress(&jpeg_);
    jpeg_.client_data = this;
    jpeg_.progress = &progress_;
    // Older headers want the bytes of others writable; nothing writes there.
    jpeg_mem_src(&jpeg_, reinterpret_cast<unsigned char*>(const_cast<std::byte*>(bytes_.data())), bytes_.size());
    (void)jpeg_read_header(&jpeg_, TRUE);
    jpeg_.out_color_space = jpeg_.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
    if (jpeg_.jpeg_color_space == JCS_CMYK || jpeg_.jpeg_color_space == JCS_YCCK) jpeg_.out_color_space = JCS_CMYK;
    jpeg_.dct_method = JDCT_ISLOW;
    return true;
  }

  [[nodiscard]] std::uint32_t width() const { return jpeg_.image_width; }
  [[nodiscard]] std::uint32_t height() const { return jpeg_.image_height; }
  /// 1: grey, 3: RGB, kInks: cyan, magenta, yellow and black.
  [[nodiscard]] std::uint32_t channels() const {
    return jpeg_.out_color_space == JCS_CMYK ? kInks : jpeg_.out_color_space == JCS_GRAYSCALE ? 1 : 3;
  }
  /// Whether 255 stands for no ink: so Adobe's programs write it.
  [[nodiscard]] bool is_inverted() const { return jpeg_.saw_Adobe_marker == TRUE; }

  /// [height][width][channels], and the file's end. False with problem().
  bool read_pixels(std::uint8_t* pixels) {
    if (setjmp(failed_) != 0) return false;
    (void)jpeg_start_decompress(&jpeg_);
    while (jpeg_.output_scanline < jpeg_.output_height) {
      JSAMPROW row = pixels + std::size_t{jpeg_.output_scanline} * jpeg_.output_width * channels();
      (void)jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    (void)jpeg_finish_decompress(&jpeg_);
    return true;
  }

 private:
  static JpegReader* self(j_common_ptr jpeg) { return static_cast<JpegReader*>(jpeg->client_data); }

  [[noreturn]] void give_up() {
    errors_.format_message(reinterpret_cast<j_common_ptr>(&jpeg_), problem_.data());
    std::longjmp(failed_, 1);
  }

  /// Of a few kilobytes a progressive file can ask for hours: each scan visits all pixels again.
  void count_scans() {
    constexpr int kMaxScans = 200;
    if (jpeg_.input_scan_number <= kMaxScans) return;
    (void)std::snprintf(problem_.data(), problem_.size(), "it has more than %d scans", kMaxScans);
    std::longjmp(failed_, 1);
  }

  std::span<const std::byte> bytes_;
  jpeg_decompress_struct jpeg_{};
  jpeg_error_mgr errors_{};
  jpeg_progress_mgr progress_{};
  std::jmp_buf failed_{};
  std::array<char, JMSG_LENGTH_MAX> problem_{};
};

/// Inks to RGB, the simple way: light that passes through all of them.
StoredPicture without_inks(const StoredPicture& inks, bool inverted) {
  StoredPicture picture{.size = inks.size, .channels = 3, .bytes = {}, .deep = false};
  picture.bytes.reserve(inks.size.area() * 3);
  const auto passes = [&](std::size_t index) { return inverted ? inks.bytes[index] : 255U - inks.bytes[index]; };
  for (std::size_t i = 0; i < inks.bytes.size(); i += kInks) {
    for (std::size_t ink = 0; ink < 3; ++ink)
      picture.bytes.push_back(static_cast<std::uint8_t>((passes(i + ink) * passes(i + 3) + 127) / 255));
  }
  return picture;
}

}  // namespace

StoredPicture decode_jpeg(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits) {
  JpegReader reader(bytes);
  if (!reader.read_header()) throw_undecodable(name, reader.problem());
  check_header(reader.width(), reader.height(), reader.channels(), name, limits);
  const Size size{static_cast<int>(reader.width()), static_cast<int>(reader.height())};
  StoredPicture picture{.size = size, .channels = reader.channels(), .bytes = {}, .deep = false};
  picture.bytes.resize(size.area() * picture.channels);
  if (!reader.read_pixels(picture.bytes.data())) throw_undecodable(name, reader.problem());
  return picture.channels == kInks ? without_inks(picture, reader.is_inverted()) : picture;
}

}  // namespace hpr
