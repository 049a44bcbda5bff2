#include "app/commands/wall_options.h"

namespace hpr {

void declare_wall(const OptionSet& options, std::string& wall) {
  options.option("wall", wall, "a wall file, or CxR, or CxR@WxH").required().type("WALL");
}

void declare_overrides(const OptionSet& options, std::vector<std::string>& overrides) {
  options.option("--set", overrides, "put a value over one of the wall file's, e.g. stereo.mode=anaglyph")
      .type("PATH=VALUE")
      .repeats();
}

void declare_target_ms(const OptionSet& options, std::optional<double>& target_ms, const std::string& text) {
  options.option("--target-ms", target_ms, text)
      .range(1e-3, 1e9)
      .units({{"us", 1e-3}, {"ms", 1.0}, {"s", 1e3}, {"min", 6e4}})
      .type("MS");
}

}  // namespace hpr
