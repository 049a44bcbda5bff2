#include "app/display_command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <filesystem>

#include "app/output.h"
#include "app/remote_wall.h"
#include "core/file.h"
#include "core/log.h"
#include "core/names.h"
#include "core/units.h"
#include "image/image_io.h"
#include "walls/display.h"
#include "walls/link/display_process.h"
#include "walls/link/hosts.h"
#include "walls/wall_file.h"

namespace hpr {
namespace {

// Handlers reach nothing but globals.
std::atomic<int> ended_by = 0;
static_assert(std::atomic<int>::is_always_lock_free);

extern "C" void remember_end(int signal) {
  ended_by.store(signal);
}

constexpr std::array kEnds{SIGINT, SIGTERM, SIGHUP};

class DisplayCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "display"; }
  [[nodiscard]] std::string_view summary() const override {
    return "show the screens of one host of a wall, for wall run --display remote";
  }

  void declare(CLI::App& app) override {
    app.add_option("--wall", wall_, "a wall file, or CxR, or CxR@WxH")->required();
    app.add_option("--host", host_,
                   "whose screens: a host of the wall file, or a node's id (not needed where there is one)");
    app.add_option("--show", show_, fmt::format("{}", fmt::join(all_displays(), " or ")))->capture_default_str();
    app.add_option("-o,--output", folder_, "folder for display.json, and the pictures of the file display")
        ->type_name("DIR");
    app.add_option("--listen", listen_, "instead of the socket wall run looks for; again for another")
        ->type_name("ADDR:PORT|PATH");
    app.add_option("--stale-after", stale_after_, "a screen without a new frame for so long is marked")
        ->capture_default_str();
    app.add_option("--scale", scale_, "of the screens' pixels: the same as wall run's")
        ->check(CLI::Range(1e-6, 1e6))
        ->capture_default_str();
    app.add_flag("--once", once_, "leave when the first run is over");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    ended_by.store(0);
    struct sigaction action {};
    action.sa_handler = remember_end;
    for (const int signal : kEnds) ::sigaction(signal, &action, nullptr);
    serve(globals);
    // As if the signal had ended us, but with everything put away.
    if (const int signal = ended_by.load(); signal != 0) {
      std::signal(signal, SIG_DFL);
      std::raise(signal);
    }
    return ExitCode::Done;
  }

 private:
  void serve(const Globals& globals) const {
    const auto stale_after = parse_duration(stale_after_);
    if (!stale_after || stale_after->count() == 0) {
      throw Error(ExitCode::Usage, fmt::format("--stale-after: '{}' is no time", printable(stale_after_)),
                  "write e.g. --stale-after 1s");
    }
    if (show_ == "file" && folder_.empty()) {
      throw Error(ExitCode::Usage, "the file display needs a folder", "name one with -o DIR, or use --show none");
    }
    if (std::ranges::find(all_displays(), show_) == all_displays().end()) {
      throw Error(ExitCode::Usage, fmt::format("unknown display '{}'", printable(show_)),
                  unknown_name_hint(show_, all_displays()));
    }
    Wall whole = load_wall(wall_);
    if (scale_ != 1.0) whole = scale_wall(std::move(whole), scale_);
    const WallHost host = find_host(whole, host_.empty() ? only_host(whole) : host_);
    const Wall wall = wall_of_host(whole, host);
    for (const WallScreen& screen : wall.screens) check_size(screen.pixels, globals);

    ReceiverSettings settings{.build = link_build(),
                              .host = host.host,
                              .wall_hash = whole.hash,
                              .screens = link_screens(whole, host),
                              .token = link_token(),
                              .listen = addresses(whole, host.host)};
    const EmptyFolders tidy(folder_);
    const auto display = make_display(show_, wall, {.folder = folder_, .overwrite = globals.force});
    if (!folder_.empty()) {
      std::error_code error;
      std::filesystem::create_directories(folder_, error);
      check_writable(std::filesystem::path(folder_) / "display.json", globals.force);
    }
    // What writes pictures is loaded now, not when the first frame is to be shown.
    if (show_ == "file") (void)encode_png(Image<Rgba8>({1, 1}));
    std::vector<std::string> places;
    for (const LinkAddress& address : settings.listen) places.push_back(address.text);
    FrameReceiver receiver(std::move(settings));
    DisplayProcess process(wall, host.host, *display, receiver, {folder_, *stale_after, once_});
    log::info("display of host '{}': {} screen{}, listening on {}", host.host, wall.screens.size(),
              wall.screens.size() == 1 ? "" : "s", fmt::join(places, " and "));
    process.run([] { return ended_by.load() != 0; });
  }

  [[nodiscard]] static std::string only_host(const Wall& wall) {
    const std::vector<WallHost> hosts = wall_hosts(wall);
    if (hosts.size() == 1) return hosts.front().host;
    std::vector<std::string> names;
    for (const WallHost& host : hosts) names.push_back(host.host);
    throw Error(ExitCode::Usage, fmt::format("the wall has {} hosts", hosts.size()),
                fmt::format("name one with --host: {}", fmt::join(names, ", ")));
  }

  [[nodiscard]] std::vector<LinkAddress> addresses(const Wall& wall, const std::string& host) const {
    std::vector<LinkAddress> found;
    for (const std::string& text : listen_) found.push_back(parse_address(text));
    if (found.empty()) found.push_back(socket_address(display_socket(wall, host)));
    return found;
  }

  std::string wall_;
  std::string host_;
  std::string show_ = "file";
  std::string folder_;
  std::vector<std::string> listen_;
  std::string stale_after_ = "1s";
  double scale_ = 1.0;
  bool once_ = false;
};

}  // namespace

std::unique_ptr<Command> make_display_command() {
  return std::make_unique<DisplayCommand>();
}

}  // namespace hpr
