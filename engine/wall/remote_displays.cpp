#include "engine/wall/remote_displays.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/log.h"
#include "walls/link/protocol.h"
#include "walls/manifest/run_journal.h"

namespace hpr {
namespace {

/// Displays that are started along with the run get this long to be there for the first frame.
constexpr std::chrono::duration<double> kWaitForDisplays{1.0};

}  // namespace

std::unique_ptr<WallSender> connect_displays(Communicator& comm, const Wall& wall, std::span<const int> owners,
                                             SenderSettings settings) {
  settings.rank = comm.rank();
  // The environment may not reach the ranks of other hosts.
  const std::vector<std::byte> secret = on_root(comm, [] {
    ByteWriter writer;
    writer.u64(make_session());
    writer.text(link_token());
    return writer.take();
  });
  ByteReader reader(secret);
  settings.session = reader.u64();
  settings.token = reader.text(secret.size());
  std::unique_ptr<WallSender> sender;
  agree_on_failure(comm, [&] {
    sender = std::make_unique<WallSender>(wall, owners, settings);
    if (comm.rank() != 0) return;
    try {
      sender->wait_for_displays(kWaitForDisplays);
    } catch (const Error&) {
      // A display that refuses this job would refuse the next one.
      if (auto journal = RunJournal::of_supervisor()) journal->add_end();
      throw;
    }
  });
  return sender;
}

bool end_displays(Communicator& comm, WallSender& sender, RunManifest& manifest) {
  // Rank 0 says that the run is over once the other ranks' pictures are on their way.
  if (comm.rank() != 0) sender.finish();
  barrier(comm);
  if (comm.rank() != 0) return true;
  sender.finish();
  std::size_t stale = 0;
  std::size_t lost = 0;
  for (FrameRecord& frame : manifest.frames) {
    const SwapOutcome outcome = sender.outcome(frame.frame);
    for (std::size_t i = 0; i < frame.screens.size(); ++i) frame.screens[i].state = outcome.screens[i];
    frame.swap = SwapRecord{};
    if (outcome.skew_s) frame.swap->skew_ms = *outcome.skew_s * 1000.0;
    const auto count = [&](ScreenState state) {
      return static_cast<std::size_t>(std::ranges::count(outcome.screens, state));
    };
    stale += count(ScreenState::Stale);
    lost += count(ScreenState::Lost);
  }
  manifest.degraded_seconds = sender.degraded_seconds();
  if (stale + lost > 0) {
    log::info(
        "of {} frames, {} pictures came too late for their screens and {} found none; {:.1f} s with something missing",
        manifest.frames.size(), stale, lost, sender.degraded_seconds());
  }
  if (sender.reached_any()) return true;
  log::error("no display was there: {}", sender.why_unreached());
  return false;
}

}  // namespace hpr
