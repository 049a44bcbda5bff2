#include "app/commands/remote_wall.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <cstring>

#include "cluster/transport/agreement.h"
#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/names.h"
#include "core/units.h"
#include "walls/link/hosts.h"
#include "walls/link/sender.h"
#include "walls/link/token.h"
#include "walls/manifest/run_journal.h"

namespace hpr {
namespace {

/// Displays that are started along with the run get this long to be there for the first frame.
constexpr std::chrono::duration<double> kWaitForDisplays{1.0};

std::chrono::duration<double> duration_of(const std::string& option, const std::string& text) {
  const auto parsed = parse_duration(text);
  if (!parsed || parsed->count() == 0 || *parsed > std::chrono::minutes(10)) {
    throw Error(ExitCode::Usage, fmt::format("{}: '{}' is no time up to ten minutes", option, printable(text)),
                fmt::format("write e.g. {} 100ms", option));
  }
  return *parsed;
}

/// Levels of 255.
int levels_of(std::string text) {
  if (text.ends_with("/255")) text.resize(text.size() - 4);
  int levels = -1;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), levels);
  if (failed != std::errc() || end != text.data() + text.size() || levels < 0 || levels > 255) {
    throw Error(ExitCode::Usage, fmt::format("--codec-error: '{}' is no number of levels", printable(text)),
                "write e.g. --codec-error 3/255, or 3");
  }
  return levels;
}

}  // namespace

void RemoteOptions::declare(CLI::App& app) {
  const auto group = [this](CLI::Option* option) {
    declared_.push_back(option);
    return option->group("With --display remote");
  };
  group(app.add_option("--displays", displays, "where displays listen that are not on this machine"))
      ->delimiter(',')
      ->type_name("HOST=ADDR:PORT,...");
  group(app.add_option("--send-budget", send_budget, "the longest a frame waits for displays"))->capture_default_str();
  group(app.add_option("--swap-timeout", swap_timeout, "the longest displays that have a frame wait for the others"))
      ->capture_default_str();
  group(app.add_option("--in-flight", in_flight, "frames the run may be ahead of its displays"))
      ->check(CLI::Range(1, 8))
      ->capture_default_str();
  group(app.add_option("--codec", codec, "of the pictures on their way: auto, or one of hpr bench codec"))
      ->capture_default_str();
  group(app.add_option("--codec-quality", codec_quality, "of jpeg, 1 to 100"))
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  group(app.add_option("--codec-error", codec_error, "levels of 255 a shown colour may be off, e.g. 3/255"))
      ->capture_default_str();
  group(
      app.add_flag("--codec-deltas", codec_deltas, "send only the tiles that changed: for pictures that mostly stand"));
}

void RemoteOptions::refuse() const {
  for (const CLI::Option* option : declared_) {
    if (option->count() == 0) continue;
    throw Error(ExitCode::Usage, fmt::format("{} is for displays outside the job", option->get_name()),
                "add --display remote");
  }
}

SenderSettings RemoteOptions::settings(const Wall& wall) const {
  SenderSettings settings;
  settings.build = link_build();
  settings.send_budget = duration_of("--send-budget", send_budget);
  settings.swap_timeout = duration_of("--swap-timeout", swap_timeout);
  settings.in_flight = in_flight;
  settings.codec = codec;
  settings.codec_settings.quality = codec_quality;
  settings.codec_settings.error = levels_of(codec_error);
  settings.codec_settings.deltas = codec_deltas;
  (void)make_codec(codec, settings.codec_settings);  // an unknown name is found before any work
  bool tcp = false;
  for (const std::string& entry : displays) {
    const std::size_t equals = entry.find('=');
    if (equals == std::string::npos) {
      throw Error(ExitCode::Usage, fmt::format("--displays: '{}' names no host", printable(entry)),
                  "write HOST=ADDR:PORT, e.g. --displays wall01=10.0.0.5:5005");
    }
    const LinkAddress address = parse_address(entry.substr(equals + 1));
    tcp = tcp || address.tcp;
    settings.addresses.insert_or_assign(find_host(wall, entry.substr(0, equals)).host, address);
  }
  for (const WallHost& host : wall_hosts(wall)) {
    if (!settings.addresses.contains(host.host)) (void)socket_address(display_socket(wall, host.host));
  }
  if (tcp && link_token().empty() && launched_rank() == 0) {
    throw Error(ExitCode::Usage, "displays behind TCP take a token",
                "set HPR_TOKEN to the same secret for the displays and for wall run");
  }
  return settings;
}

std::unique_ptr<WallSender> connect_displays(Communicator& comm, const Wall& wall, std::span<const int> owners,
                                             const RemoteOptions& options) {
  SenderSettings settings = options.settings(wall);
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
