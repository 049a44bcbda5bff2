#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "app/command.h"
#include "app/launch/launcher.h"
#include "app/launch/run_ranks.h"
#include "app/options/render_options.h"
#include "app/results.h"
#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/progress.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/checkpoint/checkpoint.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/session.h"
#include "engine/wall/command_table.h"
#include "engine/wall/controls.h"
#include "engine/wall/line_source.h"
#include "walls/link/protocol.h"

namespace hpr {

/// A resident session: a scene, how it is drawn, and the last picture of it. Every rank has one and runs the same
/// lines.
class Console {
 public:
  /// All outlive this.
  Console(Session& session, const Globals& globals, RenderSettings settings, Size size);

  /// Collective. Runs one line and returns its output. Throws Error where nothing was done: the session stays as it
  /// was.
  [[nodiscard]] std::string run(const std::string& line) { return table_.run(line); }
  [[nodiscard]] bool quits() const { return quits_; }
  /// After an error: it came in the middle of a picture, perhaps on one rank alone.
  [[nodiscard]] bool drawing() const { return drawing_; }

 private:
  /// A picture as it was drawn, whatever changed since.
  struct Picture {
    FramePlan plan;
    Blocks blocks;
    Size size;
    DisplaySettings display;
    ColorFormat colors = ColorFormat::Float32;
    std::unique_ptr<FrameSampler> sampler;
    RunStats stats;
    std::string scene_name;
  };

  std::string set_size(Arguments arguments);
  std::string render();
  std::string save(Arguments arguments);
  [[nodiscard]] std::string write_stats_of(Arguments arguments) const;
  std::string explain();
  [[nodiscard]] const Picture& picture() const;
  [[nodiscard]] View view() const;

  Session& session_;
  const Globals& globals_;
  RenderSettings settings_;
  Size size_;
  CommandTable table_;
  Controls controls_;
  std::unique_ptr<Picture> picture_;
  bool quits_ = false;
  bool drawing_ = false;
};

Console::Console(Session& session, const Globals& globals, RenderSettings settings, Size size)
    : session_(session),
      globals_(globals),
      settings_(std::move(settings)),
      size_(size),
      controls_(
          session, settings_, globals.seed,
          [this](const std::string& source, const RenderSettings& its) {
            return load_scene(source, its, globals_, size_);
          },
          table_) {
  table_.add({"size", "WxH", "pixels of the picture", [this](Arguments arguments) { return set_size(arguments); }});
  table_.add({"render", "", "draw the picture", [this](Arguments) { return render(); }});
  table_.add(
      {"save", "FILE.(png|exr)", "write the last picture", [this](Arguments arguments) { return save(arguments); }});
  table_.add({"stats", "FILE.json", "write what the last picture took",
              [this](Arguments arguments) { return write_stats_of(arguments); }});
  table_.add({"explain", "", "the plan of the next picture, and why", [this](Arguments) { return explain(); }});
  table_.add({"quit", "", "end the session", [this](Arguments) {
                quits_ = true;
                return std::string();
              }});
}

View Console::view() const {
  return make_view(choose_camera(settings_.camera, session_.scene()), size_, session_.scene().bounds);
}

std::string Console::set_size(Arguments arguments) {
  const auto extent = arguments.size() == 1 ? parse_extent(arguments[0]) : std::nullopt;
  if (!extent) refuse("a size is two numbers", "size 1920x1080");
  check_size({extent->first, extent->second}, globals_.picture_limits());
  size_ = {extent->first, extent->second};
  return "";
}

std::string Console::render() {
  const RenderSettings settings = resolve(settings_, globals_.seed);
  const View seen = view();
  auto picture = std::make_unique<Picture>();
  picture->size = size_;
  picture->display = settings.display;
  picture->colors = settings.color_format;
  picture->scene_name = session_.scene().name;
  picture->blocks = cut_blocks(std::span(&seen, 1), settings.frame.resolution_scale);
  picture->plan = plan_frame(session_, settings.frame, picture->blocks.views);
  picture_.reset();  // frees its memory before the next one takes some

  const Stopwatch watch;
  const std::size_t sent_before = session_.comm().bytes_sent();
  picture->sampler = std::make_unique<FrameSampler>(session_, picture->plan, settings.sampling, 0, false);
  Progress progress(session_.comm().rank() == 0 ? globals_.progress : "none", "sample",
                    settings.sampling.goal.samples.value_or(0));
  drawing_ = true;
  (void)picture->sampler->draw(picture->blocks.views, {}, progress);  // without a checkpoint it does not stop early
  drawing_ = false;
  picture->stats = gather_stats(session_, picture->plan, picture->sampler->times(),
                                {watch.ms(), session_.comm().bytes_sent() - sent_before});
  picture->stats.relmse = picture->sampler->sample_progress().relmse;
  picture_ = std::move(picture);
  const RunStats& stats = picture_->stats;
  return fmt::format("{}x{} pixels, {} sample{}: {:.1f} ms", size_.width, size_.height, stats.samples,
                     stats.samples == 1 ? "" : "s", stats.ms);
}

const Console::Picture& Console::picture() const {
  if (!picture_) throw Error(ExitCode::Usage, "there is no picture yet", "draw one first: render");
  return *picture_;
}

std::string Console::save(Arguments arguments) {
  if (arguments.size() != 1 || !(arguments[0].ends_with(".png") || arguments[0].ends_with(".exr"))) {
    refuse("a picture is a .png or an .exr", "save picture.png");
  }
  const Picture& last = picture();
  check_on_root(session_.comm(), [&] { check_writable(arguments[0], globals_.force); });
  PictureFiles files;
  files.picture = arguments[0];
  files.display = last.display;
  files.aovs = last.plan.aovs;
  files.colors = last.colors;
  const CollectedPicture collected(session_, last.sampler->frame(), last.blocks, last.size, files);
  agree_on_failure(session_.comm(), [&] {
    if (session_.comm().rank() == 0) collected.write(last.scene_name);
  });
  return arguments[0];
}

std::string Console::write_stats_of(Arguments arguments) const {
  if (arguments.size() != 1) refuse("where to?", "stats picture.json");
  const Picture& last = picture();
  agree_on_failure(session_.comm(), [&] {
    if (session_.comm().rank() != 0) return;
    check_writable(arguments[0], globals_.force);
    write_stats(arguments[0], last.stats);
  });
  return arguments[0];
}

std::string Console::explain() {
  const RenderSettings settings = resolve(settings_, globals_.seed);
  const View seen = view();
  const Blocks blocks = cut_blocks(std::span(&seen, 1), settings.frame.resolution_scale);
  return fmt::format("{}", fmt::join(plan_frame(session_, settings.frame, blocks.views).explained, "\n"));
}

namespace {

/// Rank 0 sends the other ranks a message at least this often: they take a longer pause for a hang.
constexpr std::chrono::milliseconds kHeartbeat{250};

class ConsoleCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "console"; }
  [[nodiscard]] std::string_view summary() const override {
    return "a resident scene, told what to do line by line; 'help' lists the commands";
  }

  void declare(const OptionSet& options) override {
    options.option("scene", source_, "a .gltf or .glb file, or gen:NAME?key=value").required();
    options.option("--listen", listen_, "also take lines from a Unix socket (a path) or from TCP (ADDRESS:PORT)")
        .type("ADDRESS");
    options.flag("--keep-going", keeps_going_, "a command that fails in a script does not end it");
    options.option("--size", size_, "pixels of the picture").show_default().type("WxH");
    declare_settings(options, settings_);
    settings_.finishes = true;
    report_.declare(options);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const auto extent = parse_extent(size_);
    if (!extent) throw Error(ExitCode::Usage, fmt::format("--size: '{}' is no size", size_), "write e.g. 1920x1080");
    check_size({extent->first, extent->second}, globals.picture_limits());
    if (!report_.stats.empty() || report_.explain) {
      throw Error(ExitCode::Usage, "--stats and --explain are commands here", "say stats FILE.json, or explain");
    }
    (void)resolve(settings_, globals.seed);
    return run_ranks(globals,
                     [&](Communicator& comm) {
                       const Size size{extent->first, extent->second};
                       Session session(comm, globals.session(),
                                       [&] { return load_scene(source_, settings_, globals, size); });
                       Console console(session, globals, settings_, size);
                       return run_lines(session.comm(), console);
                     },
                     {.input = StandardInput::OfRank0});
  }

 private:
  ExitCode run_lines(Communicator& comm, Console& console) {
    const bool is_root = comm.rank() == 0;
    std::optional<LineSource> source;
    agree_on_failure(comm, [&] {
      if (is_root) source.emplace(LineSource::Options{true, listen_});
    });
    if (is_root) report_address(*source);
    ExitCode worst = ExitCode::Done;
    while (!console.quits()) {
      const std::optional<Line> line = next_line(comm, source ? &*source : nullptr);
      if (!line) break;
      const ExitCode code = run_line(comm, console, *line);
      if (line->scripted) worst = std::max(worst, code);
    }
    return worst;
  }

  /// A line of input, the same on all ranks.
  struct Line {
    std::string text;
    bool scripted = false;         ///< by a file or a pipe
    LineSource* source = nullptr;  ///< rank 0's; null: nobody is answered here
    InputLine from;                ///< rank 0's
  };

  /// Collective. None: no line can come any more. `source`: null on ranks other than 0.
  [[nodiscard]] static std::optional<Line> next_line(Communicator& comm, LineSource* source) {
    const bool typed = source != nullptr && input_is_typed();
    if (typed) fmt::print("> ");
    if (source != nullptr) std::fflush(stdout);
    std::optional<InputLine> from;
    PolledInput input;
    while (!input.line && !input.ended) input = poll_input(comm, source, kHeartbeat, from);
    if (input.ended) return std::nullopt;
    const bool scripted = source != nullptr && !typed && from->from == STDIN_FILENO;
    return Line{std::move(*input.line), all_gather_value(comm, scripted ? 1 : 0)[0] == 1, source,
                std::move(from).value_or(InputLine{})};
  }

  /// Collective. Runs a line and answers it; what it failed with, where the session goes on all the same.
  ExitCode run_line(Communicator& comm, Console& console, const Line& line) const {
    try {
      const std::string reply = console.run(line.text);
      if (line.source != nullptr) line.source->answer(line.from, reply_to(reply, line.from));
      return ExitCode::Done;
    } catch (const Error& error) {
      if (!is_recoverable(error) || (console.drawing() && comm.size() > 1)) throw;
      const bool ends = line.scripted && !keeps_going_;
      if (ends && line.source != nullptr) throw in_line(error, line.from);
      if (ends) throw;
      if (line.source != nullptr) refuse_line(*line.source, line.from, error);
      return error.code();
    }
  }

  static void report_address(const LineSource& source) {
    if (source.address().empty()) return;
    log::info("listening on {}", source.address());
    // Not the token of the environment: who set it knows it, and logs are read by others. A generated token is always
    // printed.
    if (!source.token().empty() && source.token() != link_token()) {
      fmt::print(stderr, "hpr: the first line of a client is: token {}\n", source.token());
    }
  }

  /// Which line of a script it was.
  [[nodiscard]] static Error in_line(const Error& error, const InputLine& line) {
    return {error.code(), fmt::format("line {}: {}", line.number, error.what()), error.hint(), line.text};
  }

  /// Clients of a socket see by a last line that an answer is whole.
  [[nodiscard]] static std::string reply_to(const std::string& reply, const InputLine& line) {
    std::string answer = reply.empty() ? "" : reply + "\n";
    if (line.from != STDIN_FILENO) answer += "ok\n";
    return answer;
  }

  static void refuse_line(LineSource& source, const InputLine& line, const Error& error) {
    if (line.from == STDIN_FILENO) {
      print_error(input_is_typed() ? error : in_line(error, line));
    } else {
      source.answer(line, fmt::format("error: {} ({})\n", error.what(), error.hint()));
    }
  }

  std::string source_;
  std::string listen_;
  std::string size_ = "1280x720";
  bool keeps_going_ = false;
  RenderSettings settings_;
  ReportOptions report_;
};

}  // namespace

/// `hpr console SCENE`.
std::unique_ptr<Command> make_console_command() {
  return std::make_unique<ConsoleCommand>();
}

}  // namespace hpr
