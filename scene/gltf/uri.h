#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/file_bytes.h"

namespace hpr {

/// `text` with %XX replaced by bytes; none when a % is not followed by two hex digits.
[[nodiscard]] std::optional<std::string> percent_decoded(std::string_view text);

/// RFC 4648, strict: the standard alphabet, no white space, padding complete and its unused bits zero. None otherwise.
[[nodiscard]] std::optional<std::vector<std::byte>> base64_decoded(std::string_view text);

/// RFC 2397, its scheme in letters of any case (RFC 3986).
[[nodiscard]] bool is_data_uri(std::string_view uri);

/// Whether a data URI says that it holds a picture.
[[nodiscard]] bool is_picture_uri(std::string_view uri);

/// The bytes of "data:[type][;base64],...", whose base64 may hold % escapes. Throws Error (BadInput); `what` stands in
/// front of the message.
[[nodiscard]] std::vector<std::byte> data_uri_bytes(std::string_view uri, const std::string& what);

/// Checks that `uri` can only mean a file below the folder that holds the scene: relative, no scheme, no "..", no
/// backslash, no control character; escapes are decoded first, but what they stand for is no scheme (RFC 3986, section
/// 4.2). Returns the relative path. Throws Error (BadInput).
[[nodiscard]] std::string jailed_path(std::string_view uri, const std::string& what);

/// Reads, or maps, the regular file `uri` below `folder`, resolved so that neither the URI nor a symbolic link leaves
/// the folder. Throws Error: BadInput for a URI that is not allowed or an escape, Io when missing or unreadable, Limit
/// past `limit_bytes`.
[[nodiscard]] FileBytes read_jailed(const std::filesystem::path& folder, std::string_view uri, const std::string& what,
                                    std::uint64_t limit_bytes, bool mapped = false);

}  // namespace hpr
