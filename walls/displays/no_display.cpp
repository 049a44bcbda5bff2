#include "walls/displays/no_display.h"

namespace hpr {
namespace {

class NoDisplay final : public Display {
 public:
  [[nodiscard]] std::string_view name() const override { return "none"; }
  void show(const WallFrame& /*frame*/) override {}
};

}  // namespace

std::unique_ptr<Display> make_no_display(const Wall& /*wall*/, const DisplayOptions& /*options*/) {
  return std::make_unique<NoDisplay>();
}

void check_no_display(const Wall& /*wall*/, const DisplayOptions& /*options*/) {}

}  // namespace hpr
