#include <fmt/format.h>
#include <fmt/ranges.h>

#include <csignal>
#include <filesystem>

#include "app/command.h"
#include "app/commands/wall_run.h"
#include "app/options/display_options.h"
#include "core/file.h"
#include "core/log.h"
#include "core/signals.h"
#include "core/text.h"
#include "image/image_io.h"
#include "walls/config/wall_file.h"
#include "walls/link/display_process.h"
#include "walls/link/hosts.h"
#include "walls/link/protocol.h"
#include "walls/link/socket.h"

namespace hpr {
namespace {

class DisplayCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "display"; }
  [[nodiscard]] std::string_view summary() const override {
    return "show the screens of one host of a wall, for wall run --display remote";
  }

  [[nodiscard]] bool opens_windows() const override { return true; }

  void declare(const OptionSet& options) override {
    options.option("--wall", wall_, "a wall file, or CxR, or CxR@WxH").required();
    options.option("--host", host_,
                   "whose screens: a host of the wall file, or a node's id (not needed where there is one)");
    show_.declare(options);
    declare_overrides(options, overrides_);
    options.option("--listen", listen_, "instead of the socket wall run looks for; again for another")
        .type("ADDR:PORT|PATH");
    options.option("--stale-after", stale_after_, "a screen without a new frame for so long is marked").show_default();
    options.option("--scale", scale_, "of the screens' pixels: the same as wall run's").range(1e-6, 1e6).show_default();
    options.flag("--once", once_, "leave when the first run is over");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    watch_interrupts();
    // What tells a run to stop reaches all processes of a batch job.
    for (const int signal : {SIGUSR1, SIGUSR2}) std::signal(signal, SIG_IGN);
    serve(globals);
    // As if the signal had ended us, but with everything put away.
    if (const int signal = last_signal(); signal != 0) {
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
    const DisplayOptions options = show_.options(globals);
    const DisplayKind& kind = show_.kind();
    Wall whole = load_wall(wall_, overrides_);
    if (scale_ != 1.0) whole = scale_wall(std::move(whole), scale_);
    const WallHost host = find_host(whole, host_.empty() ? only_host(whole) : host_);
    const Wall wall = wall_of_host(whole, host);
    for (const WallScreen& screen : wall.screens) check_size(screen.pixels, globals.picture_limits());

    ReceiverSettings settings{.build = link_build(),
                              .host = host.host,
                              .wall_hash = whole.hash,
                              .screens = link_screens(whole, host),
                              .token = link_token(),
                              .listen = addresses(whole, host.host)};
    const std::string& folder = show_.output;
    const EmptyFolders tidy(folder);
    kind.check(wall, options);
    if (!folder.empty()) {
      std::error_code error;
      std::filesystem::create_directories(folder, error);
      check_writable(std::filesystem::path(folder) / "display.json", globals.force);
    }
    const auto display = kind.make(wall, options);
    // What writes pictures is loaded now, not when the first frame is to be shown.
    if (kind.name == "file") (void)encode_png(Image<Rgba8>({1, 1}));
    remove_left_sockets(socket_folder());
    FrameReceiver receiver(std::move(settings));
    DisplayProcess process(wall, host.host, *display, receiver, {folder, *stale_after, once_});
    log::info("display of host '{}': {} screen{}, listening on {}", host.host, wall.screens.size(),
              wall.screens.size() == 1 ? "" : "s", fmt::join(receiver.addresses(), " and "));
    process.run([] { return take_request() == Request::Stop; });
  }

  [[nodiscard]] static std::string only_host(const Wall& wall) {
    const std::vector<WallHost> hosts = wall_hosts(wall);
    if (hosts.size() == 1) return hosts.front().host;
    std::vector<std::string> names;
    names.reserve(hosts.size());
    for (const WallHost& host : hosts) names.push_back(host.host);
    throw Error(ExitCode::Usage, fmt::format("the wall has {} hosts", hosts.size()),
                fmt::format("name one with --host: {}", fmt::join(names, ", ")));
  }

  [[nodiscard]] std::vector<LinkAddress> addresses(const Wall& wall, const std::string& host) const {
    std::vector<LinkAddress> found;
    for (const std::string& text : listen_) found.push_back(parse_listen_address(text));
    if (found.empty()) found.push_back(socket_address(display_socket(wall, host)));
    return found;
  }

  std::string wall_;
  std::string host_;
  std::vector<std::string> overrides_;
  DisplayFlags show_{.flag = "--show", .outside_job = true};
  std::vector<std::string> listen_;
  std::string stale_after_ = "1s";
  double scale_ = 1.0;
  bool once_ = false;
};

}  // namespace

/// `hpr display`: a display process outside the MPI job.
std::unique_ptr<Command> make_display_command() {
  return std::make_unique<DisplayCommand>();
}

}  // namespace hpr
