#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace hpr {

/// What a PNG says about itself in words: by keyword, Latin-1.
using PngTexts = std::map<std::string, std::string>;

/// Puts tEXt chunks (PNG specification, 11.3.4.3) between the header and the pixels of a PNG. Keywords have 1 to 79
/// characters.
void add_png_texts(std::vector<std::byte>& png, const PngTexts& texts);

/// The tEXt chunks before the pixels of a file that may be damaged: as far as they are whole.
[[nodiscard]] PngTexts png_texts(std::span<const std::byte> file);

}  // namespace hpr
