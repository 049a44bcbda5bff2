#pragma once

#include <string>

namespace hpr {

/// What `hpr help knobs` prints; with --markdown the table of docs/knobs.md.
[[nodiscard]] std::string tradeoff_settings_text();
[[nodiscard]] std::string tradeoff_settings_markdown();
/// The table of docs/cli.md: every setting, and its values under each quality where those differ.
[[nodiscard]] std::string settings_markdown();
/// The table of docs/quality.md: what each quality stands for.
[[nodiscard]] std::string qualities_markdown();

}  // namespace hpr
