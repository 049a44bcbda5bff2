#include "app/options/display_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <string_view>
#include <vector>

#include "app/options/render_options.h"
#include "core/error.h"
#include "core/job_environment.h"
#include "core/text.h"
#include "walls/codecs/codec.h"
#include "walls/link/hosts.h"
#include "walls/link/protocol.h"

namespace hpr {
namespace {

std::string name_in(const std::string& display) {
  return display.substr(0, display.find('='));
}

/// At once, also where stdout is a pipe or file: somebody waits for it.
void print_line(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

}  // namespace

void DisplayFlags::declare(const OptionSet& options) {
  const char* const remote_too = outside_job ? " or none" : ", none, or remote: display processes, see hpr display";
  options.option(flag, display, fmt::format("file, window, web, web=ADDR:PORT, pipe{}", remote_too)).show_default();
  options
      .option("-o,--output", output,
              outside_job ? "folder for display.json, and the pictures of the file display"
                          : "folder for the file display's pictures and the manifest; file or - for the pipe display")
      .type(outside_job ? "DIR" : "PATH");
  options.flag("--keep-frames", keep_frames, "the file display keeps every frame, in DIR/frame-000042/");
  options.option("--pipe-to", pipe_to, "the pipe display's frames go to this command's standard input").type("COMMAND");
  options.option("--pipe-format", pipe_format, "of the pipe display: y4m or rgba").show_default();
  options.option("--pipe-screen", pipe_screen, "the pipe display sends this screen instead of the assembled wall")
      .type("ID");
  options.option("--pipe-fps", pipe_fps, "frames per second as Y4M says it").range(1, 1000).show_default();
  options.option("--pipe-timeout", pipe_timeout, "how long the pipe's reader may read nothing").show_default();
}

const DisplayKind& DisplayFlags::kind() const {
  static const DisplayKind elsewhere{
      .name = kRemoteDisplay, .make = find_display("none").make, .check = find_display("none").check};
  static const std::vector<std::string> elsewhere_only{std::string(kRemoteDisplay)};
  if (remote() && !outside_job) return elsewhere;
  return find_display(name_in(display), outside_job ? std::span<const std::string>() : elsewhere_only);
}

DisplayOptions DisplayFlags::options(const Globals& globals) const {
  const std::string_view name = kind().name;
  const std::size_t value = display.find('=');
  if (value != std::string::npos && name != "web") {
    throw Error(ExitCode::Usage, fmt::format("the {} display takes no value", name), "only web=ADDR:PORT does");
  }
  if (name == "file" && output.empty()) {
    throw Error(ExitCode::Usage, "the file display needs a folder",
                fmt::format("name one with -o DIR, or use {} none", flag));
  }
  if (name != "file" && keep_frames) {
    throw Error(ExitCode::Usage, "only the file display keeps frames",
                fmt::format("use {} file with --keep-frames", flag));
  }
  if (name != "pipe" && !(pipe_to.empty() && pipe_screen.empty())) {
    throw Error(ExitCode::Usage, "--pipe-to and --pipe-screen are the pipe display's",
                fmt::format("add {} pipe", flag));
  }
  DisplayOptions made{.folder = output, .overwrite = globals.force, .keep_frames = keep_frames};
  made.pipe = {.command = pipe_to,
               .file = outside_job ? "" : output,
               .format = parse_pipe_format(pipe_format),
               .screen = pipe_screen,
               .frames_per_second = pipe_fps,
               .time_limit = to_milliseconds(parse_time_limit("--pipe-timeout", pipe_timeout, "30s"))};
  if (value != std::string::npos) made.web_address = display.substr(value + 1);
  made.announce = print_line;
  return made;
}

bool DisplayFlags::frames_on_stdout() const {
  return name_in(display) == "pipe" && pipe_to.empty() && output == "-";
}

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

namespace {

struct FailOn {
  std::string_view name;
  MissedPictures what;
};
constexpr std::array<FailOn, 4> kFailOn{{{"never", MissedPictures::Never},
                                         {"unseen", MissedPictures::Unseen},
                                         {"lost", MissedPictures::Lost},
                                         {"stale", MissedPictures::Stale}}};

std::vector<std::string> fail_on_names() {
  std::vector<std::string> names;
  names.reserve(kFailOn.size());
  for (const FailOn& each : kFailOn) names.emplace_back(each.name);
  return names;
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
      options
          .option("--fail-on", fail_on,
                  "what ends the run with 7: never, unseen (no display was ever there), lost (or one was gone for a "
                  "frame), stale (or a frame was late)")
          .choices(fail_on_names())
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
    if (!option.specified()) continue;
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
  settings.fail_on = std::ranges::find(kFailOn, fail_on, &FailOn::name)->what;
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
