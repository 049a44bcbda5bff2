#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cluster/transport/communicator.h"
#include "walls/config/wall.h"
#include "walls/manifest/manifest.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace hpr {

class WallSender;
struct SenderSettings;

/// How `wall run --display remote` reaches its displays: options, declared once.
struct RemoteOptions {
  std::vector<std::string> displays;  ///< HOST=ADDRESS
  std::string send_budget = "100ms";
  std::string swap_timeout = "100ms";
  int in_flight = 1;
  std::string codec = "auto";
  int codec_quality = 90;
  std::string codec_error = "0";  ///< "3", "3/255"
  bool codec_deltas = false;

  void declare(CLI::App& app);
  /// Throws Error (Usage) when one of them was given: nothing is sent to displays.
  void refuse() const;
  /// Throws Error (Usage, Io) for what makes no sense for this wall. Without session, token and rank.
  [[nodiscard]] SenderSettings settings(const Wall& wall) const;

 private:
  std::vector<const CLI::Option*> declared_;
};

/// Collective. The link of each rank to the displays of its screens (`owners`: per screen the rank); rank 0 has waited
/// a moment for them. Throws Error (Lost) on all ranks where one refuses.
[[nodiscard]] std::unique_ptr<WallSender> connect_displays(Communicator& comm, const Wall& wall,
                                                           std::span<const int> owners, const RemoteOptions& options);

/// Collective: ends the links of a run whose frames are in `manifest`, and writes down there, on rank 0, what the
/// displays showed of them. Returns whether any display was ever there.
[[nodiscard]] bool end_displays(Communicator& comm, WallSender& sender, RunManifest& manifest);

}  // namespace hpr
