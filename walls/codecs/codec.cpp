#include "walls/codecs/codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "core/error.h"
#include "core/text.h"
#include "walls/codecs/auto.h"
#include "walls/codecs/coder.h"
#include "walls/codecs/stream_codec.h"

namespace hpr {

std::span<const CoderKind> all_coders() {
#define HPR_LIST_CODER(name) name##_coder(),
  static const std::array kinds{HPR_CODERS(HPR_LIST_CODER)};
#undef HPR_LIST_CODER
  return kinds;
}

const std::vector<std::string>& all_codecs() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const CoderKind& kind : all_coders()) all.emplace_back(kind.name);
    all.emplace_back("auto");
    return all;
  }();
  return names;
}

std::unique_ptr<Codec> make_codec(std::string_view name, const CodecSettings& settings) {
  if (settings.quality < 1 || settings.quality > 100) {
    throw Error(ExitCode::Usage, fmt::format("a picture's quality cannot be {}", settings.quality), "say 1 to 100");
  }
  if (settings.error < 0 || settings.error > 255) {
    throw Error(ExitCode::Usage, fmt::format("a picture's error cannot be {}", settings.error), "say 0 to 255");
  }
  if (!(settings.link_bytes_per_second > 0.0) || settings.cores < 1) {
    throw Error(ExitCode::Usage, "a link has bytes per second and a codec has cores", "say more than 0");
  }
  if (name == "auto") return std::make_unique<AutoCodec>(settings);
  const std::span<const CoderKind> kinds = all_coders();
  const auto found = std::ranges::find(kinds, name, &CoderKind::name);
  if (found != kinds.end()) {
    return std::make_unique<StreamCodec>(static_cast<std::size_t>(found - kinds.begin()), settings);
  }
  throw Error(ExitCode::Usage, fmt::format("unknown codec '{}'", printable(name)),
              unknown_name_hint(name, all_codecs()));
}

}  // namespace hpr
