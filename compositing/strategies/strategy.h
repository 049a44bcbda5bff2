#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "cluster/transport/communicator_wrappers.h"
#include "compositing/compositor.h"

/// The list of strategies, and what their files share.
///
/// A strategy for keys alone implements Compositor. One that merges only what neighbours in rank hold is a *schedule*
/// of messages and works on colours as well: a class template over the pixel, whose objects keep their memory from
/// frame to frame and have predict() and fits() as a Compositor (fits() may be left out) and run(comm, layer, tiles,
/// shown_by) as Compositor::composite.
namespace hpr {

/// How to make a strategy; defined in the file of its name. A maker is called with the name the user wrote: that of the
/// strategy, followed by a colon and parameters where it takes some.
struct Strategy {
  template <typename Product>
  using Make = std::unique_ptr<Product> (*)(std::string_view written_name);

  std::string_view name;
  Make<Compositor> make_compositor = nullptr;
  /// Null where the strategy does not keep the order of layers, as `over` needs.
  Make<Blender<Rgba8Premultiplied>> make_rgba8_blender = nullptr;
  Make<Blender<RgbaPremultiplied>> make_rgba_blender = nullptr;
  bool takes_parameters = false;
};

/// Every strategy, in the order in which reports list them: X(tree) stands for tree.cpp, which defines tree_strategy().
#define HPR_STRATEGIES(X) \
  X(serial)               \
  X(tree)                 \
  X(binary_swap)          \
  X(radix_k)              \
  X(direct_send)          \
  X(ring)                 \
  X(shared_memory)        \
  X(mpi_reduce)           \
  X(auto)

#define HPR_DECLARE_STRATEGY(name) [[nodiscard]] Strategy name##_strategy();
HPR_STRATEGIES(HPR_DECLARE_STRATEGY)
#undef HPR_DECLARE_STRATEGY

/// Makes a Compositor or Blender that needs no name to be made.
template <typename Product, typename Implementation>
[[nodiscard]] std::unique_ptr<Product> make_implementation(std::string_view /*written_name*/) {
  return std::make_unique<Implementation>();
}

/// A schedule and the name the user wrote, from which a schedule that takes parameters is constructed.
template <typename Schedule>
struct NamedSchedule {
  static constexpr bool kTakesParameters = std::is_constructible_v<Schedule, std::string_view>;

  explicit NamedSchedule(std::string_view written_name) : name(written_name), schedule(make(written_name)) {}

  [[nodiscard]] bool fits(int ranks) const {
    if constexpr (requires { schedule.fits(ranks); }) {
      return schedule.fits(ranks);
    } else {
      return ranks >= 1;
    }
  }

  std::string name;
  Schedule schedule;

 private:
  [[nodiscard]] static Schedule make(std::string_view written_name) {
    if constexpr (kTakesParameters) {
      return Schedule(written_name);
    } else {
      return Schedule();
    }
  }
};

/// A schedule at work on keys.
template <typename Schedule>
class ScheduledCompositor final : public Compositor {
 public:
  explicit ScheduledCompositor(std::string_view written_name) : named_(written_name) {}

  [[nodiscard]] std::string_view name() const override { return named_.name; }
  [[nodiscard]] bool fits(int ranks) const override { return named_.fits(ranks); }
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override {
    return named_.schedule.predict(costs, load);
  }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override {
    return named_.schedule.run(comm, layer, tiles, shown_by);
  }

 private:
  NamedSchedule<Schedule> named_;
};

/// A schedule at work on colours: on ranks renumbered from front to back.
template <typename Pixel, typename Schedule>
class ScheduledBlender final : public Blender<Pixel> {
 public:
  explicit ScheduledBlender(std::string_view written_name) : named_(written_name) {}

  [[nodiscard]] std::string_view name() const override { return named_.name; }
  [[nodiscard]] bool fits(int ranks) const override { return named_.fits(ranks); }
  [[nodiscard]] bool merges_in_place() const override { return false; }
  Composited blend(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                   std::span<const int> order, std::span<const int> shown_by) override {
    RenumberedCommunicator ordered(comm, order);
    std::vector<int> shown_at;
    for (const int rank : shown_by) {
      shown_at.push_back(static_cast<int>(std::ranges::find(order, rank) - order.begin()));
    }
    return named_.schedule.run(ordered, layer, tiles, shown_at);
  }

 private:
  NamedSchedule<Schedule> named_;
};

template <typename Pixel, template <typename> typename Schedule>
[[nodiscard]] std::unique_ptr<Blender<Pixel>> make_scheduled_blender(std::string_view written_name) {
  return std::make_unique<ScheduledBlender<Pixel, Schedule<Pixel>>>(written_name);
}

/// The strategy of a schedule.
template <template <typename> typename Schedule>
[[nodiscard]] Strategy scheduled_strategy(std::string_view name) {
  return {name,
          [](std::string_view written_name) -> std::unique_ptr<Compositor> {
            return std::make_unique<ScheduledCompositor<Schedule<Key>>>(written_name);
          },
          make_scheduled_blender<Rgba8Premultiplied, Schedule>, make_scheduled_blender<RgbaPremultiplied, Schedule>,
          NamedSchedule<Schedule<Key>>::kTakesParameters};
}

}  // namespace hpr
