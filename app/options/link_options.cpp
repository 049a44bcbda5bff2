#include "app/options/link_options.h"

#include <fmt/format.h>

#include <chrono>

#include "app/options/render_options.h"
#include "core/error.h"
#include "core/job_environment.h"
#include "core/text.h"
#include "walls/codecs/codec.h"
#include "walls/link/hosts.h"
#include "walls/link/protocol.h"

namespace hpr {
namespace {

std::chrono::duration<double> duration_of(const std::string& option, const std::string& text) {
  const auto parsed = parse_duration(text);
  if (!parsed || parsed->count() == 0 || *parsed > std::chrono::minutes(10)) {
    throw Error(ExitCode::Usage, fmt::format("{}: '{}' is no time up to ten minutes", option, printable(text)),
                fmt::format("write e.g. {} 100ms", option));
  }
  return *parsed;
}

}  // namespace

void LinkOptions::declare(const OptionSet& options, RenderSettings& settings) {
  const std::string heading = "With --display remote";
  declared_ = {
      options.option("--displays", displays, "where displays listen that are not on this machine")
          .list()
          .type("HOST=ADDR:PORT,...")
          .group(heading),
      options.option("--send-budget", send_budget, "the longest a frame waits for displays")
          .show_default()
          .group(heading),
      options.option("--swap-timeout", swap_timeout, "the longest displays that have a frame wait for the others")
          .show_default()
          .group(heading),
      options.option("--in-flight", in_flight, "frames the run may be ahead of its displays")
          .range(1, 8)
          .show_default()
          .group(heading),
      options.flag("--codec-deltas", codec_deltas, "send only the tiles that changed: for pictures that mostly stand")
          .group(heading),
  };
  for (const Option& option : declare_settings(options, settings, SettingScope::Wall)) {
    declared_.push_back(option.group(heading));
  }
}

void LinkOptions::refuse() const {
  for (const Option& option : declared_) {
    if (!option.given()) continue;
    throw Error(ExitCode::Usage, fmt::format("{} is for displays outside the job", option.name()),
                "add --display remote");
  }
}

SenderSettings LinkOptions::settings(const Wall& wall, const LinkCodec& codec) const {
  SenderSettings settings;
  settings.build = link_build();
  settings.send_budget = duration_of("--send-budget", send_budget);
  settings.swap_timeout = duration_of("--swap-timeout", swap_timeout);
  settings.in_flight = in_flight;
  settings.codec = codec.name;
  settings.codec_settings.quality = codec.quality;
  settings.codec_settings.error = codec.error;
  settings.codec_settings.deltas = codec_deltas;
  (void)make_codec(codec.name, settings.codec_settings);  // an unknown name is found before any work
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

}  // namespace hpr
