#include "image/png_texts.h"

#include <gtest/gtest.h>

#include "image/image_io.h"

namespace hpr {
namespace {

const PngTexts kTexts{{"hpr:tone", "neutral"}, {"hpr:exposure", "-1.25"}, {"empty", ""}};

std::vector<std::byte> picture_with_texts() {
  std::vector<std::byte> file = encode_png(Image<Rgba8>({3, 2}, {1, 2, 3, 255}));
  add_png_texts(file, kTexts);
  return file;
}

TEST(PngTexts, AreReadBackAndChangeNoPixel) {
  const std::vector<std::byte> file = picture_with_texts();
  EXPECT_EQ(png_texts(file), kTexts);
  // libpng checks the chunks' sums.
  EXPECT_EQ(decode_image(file, "made", kPictureLimits), Image<Rgba8>({3, 2}, {1, 2, 3, 255}));
  EXPECT_EQ(decode_float_image(file, "made", kPictureLimits).texts, kTexts);
  EXPECT_TRUE(png_texts(encode_png(Image<Rgba8>({3, 2}))).empty());
}

TEST(PngTexts, OfAFileThatEndsEarlyAreThoseThatAreWhole) {
  const std::vector<std::byte> file = picture_with_texts();
  for (std::size_t size = 0; size <= file.size(); ++size) {
    for (const auto& [keyword, text] : png_texts(std::span(file).first(size))) EXPECT_EQ(text, kTexts.at(keyword));
  }
  std::vector<std::byte> longer = file;
  longer[33] = std::byte{0xFF};  // the first chunk's length
  EXPECT_TRUE(png_texts(longer).empty());
}

}  // namespace
}  // namespace hpr
