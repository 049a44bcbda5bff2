#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/drawing/assemble.h"

namespace hpr {

class Communicator;
class WallSender;
enum class MissedPictures : std::uint8_t;
struct RunManifest;
struct SenderSettings;
struct Wall;

/// Per screen the rank that shows it: the one the wall file names, else one on the screen's host, else any: no more
/// ranks than the pixels keep busy, each with neighbouring screens. `hosts`: per rank. `remote`: displays outside the
/// job show them. Warns where the wall file cannot be followed.
[[nodiscard]] std::vector<int> owners_of(const Wall& wall, const std::vector<std::string>& hosts, bool remote);

/// Collective. The link of each rank to the displays of its screens (`owners`: per screen the rank); rank 0 has waited
/// a moment for them. Throws Error (Lost) on all ranks where one refuses.
[[nodiscard]] std::unique_ptr<WallSender> connect_displays(Communicator& comm, const Wall& wall,
                                                           std::span<const int> owners, SenderSettings settings);

/// Collective: ends the links of a run whose frames are in `manifest`, and writes down there, on rank 0, what the
/// displays showed of them. Returns false where they missed what `fail_on` says.
[[nodiscard]] bool end_displays(Communicator& comm, WallSender& sender, MissedPictures fail_on, RunManifest& manifest);

/// The operators' monitors of a wall, made of the screens' pictures where those are: only what a monitor shows of them
/// is sent.
class WallMonitors {
 public:
  /// `wall` must outlive this.
  explicit WallMonitors(const Wall& wall);

  [[nodiscard]] bool any() const { return !layouts_.empty(); }

  /// Collective. One picture per monitor, on rank 0; empty elsewhere. `pictures`: per screen, on the rank that
  /// `shown_by` has for it.
  [[nodiscard]] std::vector<Image<Rgba8>> draw(Communicator& comm, std::span<const Image<Rgba8>> pictures,
                                               std::span<const int> shown_by) const;

 private:
  const Wall& wall_;
  std::vector<MonitorLayout> layouts_;
};

}  // namespace hpr
