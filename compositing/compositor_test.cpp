#include "compositing/compositor.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "compositing/compositor_contract.h"
#include "core/error.h"

namespace hpr {
namespace {

using test::CompositorContract;

/// A new strategy is tested by being listed.
std::vector<test::ContractCase> every_strategy() {
  std::vector<test::ContractCase> cases;
  for (const auto& compositor : all_compositors()) {
    const std::string name(compositor->name());
    const auto own = test::contract_cases([name] { return make_compositor(name); });
    cases.insert(cases.end(), own.begin(), own.end());
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(EveryStrategy, CompositorContract, testing::ValuesIn(every_strategy()),
                         test::contract_case_name);

TEST(AllCompositors, FitEveryNumberOfRanks) {
  EXPECT_EQ(every_strategy().size(), 10 * all_compositors().size());
}

class Named final : public Compositor {
 public:
  explicit Named(std::string name) : name_(std::move(name)) {}
  [[nodiscard]] std::string_view name() const override { return name_; }
  Composited composite(Communicator& /*comm*/, TileLayer<Key>& /*layer*/, std::span<const std::size_t> tiles,
                       std::span<const int> /*shown_by*/) override {
    return owning(tiles, {0, tiles.size()});
  }

 private:
  std::string name_;
};

TEST(RegisterCompositor, RefusesNamesThatAreTakenOrCannotStandInAList) {
  for (const char* name : {"tree", "", "a,b", "a b", "radix-k:2"}) {
    EXPECT_THROW(register_compositor([name] { return std::make_unique<Named>(name); }), Error) << name;
  }
}

TEST(MakeCompositor, NamesTheNearestChoiceWhenThereIsNoSuchStrategy) {
  try {
    (void)make_compositor("binray-swap");
    FAIL() << "expected an Error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_STREQ(error.what(), "no compositing strategy is named 'binray-swap'");
    std::string hint = "did you mean 'binary-swap'? choices:";
    for (const auto& compositor : all_compositors()) hint += fmt::format(" {},", compositor->name());
    hint.pop_back();
    EXPECT_EQ(error.hint(), hint);
  }
}

}  // namespace
}  // namespace hpr
