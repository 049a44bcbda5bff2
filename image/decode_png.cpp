#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstring>

#include "core/error.h"
#include "image/stored_picture.h"

namespace hpr {
namespace {

/// Reads one file by libpng. The library reports errors by longjmp(), so no function that sets its target has a
/// variable with a destructor.
class PngReader {
 public:
  explicit PngReader(std::span<const std::byte> bytes) : left_(bytes) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, keep_problem, ignore_warning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw Error(ExitCode::Limit, "libpng has no memory left", "free some");
    }
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  [[nodiscard]] const char* problem() const { return problem_.data(); }

  /// Up to the first pixel; makes room for none. False with problem().
  bool read_header() {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_read_fn(png_, this, read_bytes);
    // Pixels and what says how they are stored: profiles, texts, times and gammas are skipped without a look at them.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_set_user_limits(png_, 0x7FFFFFFF, 0x7FFFFFFF);  // check_header() has ours
    png_read_info(png_, info_);
    return true;
  }

  /// Afterwards channels() and is_deep() are those of pixels as they are read. Makes room for a row. False with
  /// problem().
  bool start() {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_expand(png_);
    if (std::endian::native == std::endian::little) png_set_swap(png_);
    (void)png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }

  [[nodiscard]] std::uint32_t width() const { return png_get_image_width(png_, info_); }
  [[nodiscard]] std::uint32_t height() const { return png_get_image_height(png_, info_); }
  [[nodiscard]] std::size_t channels() const { return png_get_channels(png_, info_); }
  [[nodiscard]] bool is_deep() const { return png_get_bit_depth(png_, info_) == 16; }
  [[nodiscard]] std::size_t row_bytes() const { return png_get_rowbytes(png_, info_); }

  /// All pixels, to the rows, and the file's end. False with problem().
  bool read_pixels(std::span<png_bytep> rows) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_read_image(png_, rows.data());
    png_read_end(png_, nullptr);
    return true;
  }

 private:
  static void read_bytes(png_structp png, png_bytep into, std::size_t count) {
    auto* const self = static_cast<PngReader*>(png_get_io_ptr(png));
    if (count > self->left_.size()) png_error(png, "the file ends too early");
    std::memcpy(into, self->left_.data(), count);
    self->left_ = self->left_.subspan(count);
  }
  [[noreturn]] static void keep_problem(png_structp png, png_const_charp problem) {
    auto* const self = static_cast<PngReader*>(png_get_error_ptr(png));
    const std::size_t length = std::min(std::strlen(problem), self->problem_.size() - 1);
    std::memcpy(self->problem_.data(), problem, length);
    self->problem_[length] = '\0';
    png_longjmp(png, 1);
  }
  static void ignore_warning(png_structp, png_const_charp) {}

  std::span<const std::byte> left_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::array<char, 128> problem_{};
};

}  // namespace

StoredPicture decode_png(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits) {
  PngReader reader(bytes);
  if (!reader.read_header()) throw_undecodable(name, reader.problem());
  check_header(reader.width(), reader.height(), reader.channels(), name, limits);
  if (!reader.start()) throw_undecodable(name, reader.problem());
  StoredPicture picture{.size = {static_cast<int>(reader.width()), static_cast<int>(reader.height())},
                        .channels = reader.channels(),
                        .bytes = std::vector<std::uint8_t>(reader.row_bytes() * reader.height()),
                        .deep = reader.is_deep()};
  HPR_CHECK(picture.bytes.size() == picture.size.area() * picture.channels * (picture.deep ? 2 : 1));
  std::vector<png_bytep> rows(reader.height());
  for (std::size_t y = 0; y < rows.size(); ++y) rows[y] = picture.bytes.data() + y * reader.row_bytes();
  if (!reader.read_pixels(rows)) throw_undecodable(name, reader.problem());
  return picture;
}

}  // namespace hpr
