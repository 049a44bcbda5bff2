#include "walls/displays/display.h"

namespace hpr {
namespace {

/// Shows nothing: for measuring, and for runs whose other results count.
class NoneDisplay final : public Display {
 public:
  [[nodiscard]] std::string_view name() const override { return "none"; }
  void show(const WallFrame& /*frame*/) override {}
};

std::unique_ptr<Display> make_none_display(const Wall& /*wall*/, const DisplayOptions& /*options*/) {
  return std::make_unique<NoneDisplay>();
}

void check_none_display(const Wall& /*wall*/, const DisplayOptions& /*options*/) {}

}  // namespace

DisplayKind none_display() {
  return {.name = "none", .make = make_none_display, .check = check_none_display};
}

}  // namespace hpr
