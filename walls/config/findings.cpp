#include "walls/config/findings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "core/text.h"

namespace hpr {
namespace {

std::string_view line_of(std::string_view text, int line) {
  for (; line > 1; --line) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return {};
    text.remove_prefix(end + 1);
  }
  text = text.substr(0, text.find('\n'));
  if (text.ends_with('\r')) text.remove_suffix(1);
  return text;
}

}  // namespace

/// What an expansion has wrong comes of the overrides, and all of them may have a part in it.
std::string Findings::where(TextPlace place) const {
  const std::string wall = kind_ == WallText::Expansion ? fmt::format("{} with ", printable(name_)) : "";
  if (place.option > 0) {
    return fmt::format("{}--set {}: ", wall, printable(overrides_.at(static_cast<std::size_t>(place.option - 1))));
  }
  if (kind_ == WallText::Expansion && !overrides_.empty()) {
    return fmt::format("{}--set {}: ", wall, printable(fmt::format("{}", fmt::join(overrides_, " --set ")), 200));
  }
  return place.line > 0 ? fmt::format("{}:{}:{}: ", name_, place.line, place.column) : fmt::format("{}: ", name_);
}

void Findings::add(bool error, TextPlace place, std::string_view what, std::string hint) {
  constexpr std::size_t kLineLimit = 200;
  const std::string where = this->where(place);
  if (kind_ == WallText::Expansion) place.line = place.column = 0;
  const std::string line = place.line > 0 ? printable(line_of(text_, place.line), kLineLimit) : std::string();
  findings_.push_back({error, place, where + std::string(what), line, std::move(hint)});
}

void Findings::ignore(TextPlace place, const std::string& key) {
  if (ignored_.empty()) first_ignored_ = place;
  if (std::ranges::find(ignored_, key) == ignored_.end()) ignored_.push_back(key);
}

bool Findings::any_errors() const {
  return std::ranges::any_of(findings_, &WallFinding::error);
}

std::vector<WallFinding> Findings::take() {
  if (!ignored_.empty()) {
    warning(first_ignored_, fmt::format("not acted on by this version: {}", fmt::join(ignored_, ", ")),
            "the wall is used without them");
    ignored_.clear();
  }
  std::ranges::stable_sort(findings_, [](const WallFinding& a, const WallFinding& b) {
    return a.place.line != b.place.line ? a.place.line < b.place.line : a.place.column < b.place.column;
  });
  return std::move(findings_);
}

}  // namespace hpr
