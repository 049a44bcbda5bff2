#include "app/render_command.h"

#include <fmt/format.h>

#include <filesystem>
#include <set>

#include "app/launcher.h"
#include "app/output.h"
#include "app/render_options.h"
#include "cluster/scene_distribution.h"
#include "compositing/assembly.h"
#include "core/file.h"
#include "core/log.h"
#include "core/stopwatch.h"
#include "core/units.h"
#include "image/image_io.h"

namespace hpr {
namespace {

class RenderCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "render"; }
  [[nodiscard]] std::string_view summary() const override { return "draw a scene into a picture"; }

  void declare(CLI::App& app) override {
    app.add_option("scene", source_, "a .gltf or .glb file, or gen:NAME?key=value")->required();
    app.add_option("-o,--output", output_, "the picture: .png or .exr");
    app.add_option("--size", size_, "pixels of the picture")->capture_default_str()->type_name("WxH");
    app.add_option("--raw", raw_, "write the keys: per pixel a 64-bit word, depth above surface, row 0 at the top");
    options_.declare(app);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const auto extent = parse_extent(size_);
    if (!extent) throw Error(ExitCode::Usage, fmt::format("--size: '{}' is no size", size_), "write e.g. 1920x1080");
    const Size size{extent->first, extent->second};
    check_size(size, globals);
    if (!inside_mpi_job()) check_outputs(globals);
    const FrameSettings settings = options_.settings();
    return run_ranks(globals, [&](Communicator& comm) {
      if (inside_mpi_job()) check_on_root(comm, [&] { check_outputs(globals); });
      Session session(comm, globals, [&] { return load_scene(source_, globals.scene_limits()); });
      return draw(session, settings, size);
    });
  }

 private:
  void check_outputs(const Globals& globals) const {
    if (output_.empty() && raw_.empty() && options_.stats.empty() && !options_.explain) {
      throw Error(ExitCode::Usage, "nothing to write", "name a picture with -o, or use --raw, --stats or --explain");
    }
    if (!output_.empty() && !output_.ends_with(".png") && !output_.ends_with(".exr")) {
      throw Error(ExitCode::Usage, fmt::format("cannot write '{}': unknown picture format", output_),
                  "name a .png or .exr file");
    }
    if (!raw_.empty() && options_.shading == "local") {
      throw Error(ExitCode::Usage, "--raw writes surfaces, which --shading local replaces by colours",
                  "use --shading deferred");
    }
    if (output_.ends_with(".exr") && options_.shading == "local") {
      log::warning("--shading local composites 8-bit display colours: '{}' will hold no more than those", output_);
    }
    std::set<std::filesystem::path> paths;
    for (const std::string& path : {output_, raw_, options_.stats}) {
      if (!path.empty() && !paths.insert(std::filesystem::weakly_canonical(path)).second) {
        throw Error(ExitCode::Usage, fmt::format("'{}' is named for two results", path), "give each its own name");
      }
      if (!path.empty()) check_writable(path, globals.force);
    }
  }

  ExitCode draw(Session& session, const FrameSettings& settings, Size size) {
    const View view = make_view(options_.choose_camera(session.scene()), size, session.scene().bounds);
    const Blocks blocks = cut_blocks(std::span(&view, 1));
    FramePlan plan = plan_frame(session, settings, blocks.views);
    plan.lit = !output_.empty() || !options_.stats.empty();
    const bool speaks = session.comm().rank() == 0;
    if (options_.explain && speaks) {
      for (const std::string& line : plan.explained) fmt::print("{}\n", line);
    }
    if (output_.empty() && raw_.empty() && options_.stats.empty()) return ExitCode::Done;

    prepare(session, plan);
    const Stopwatch watch;
    const std::size_t sent_before = session.comm().bytes_sent();
    FrameTimes times;
    Frame frame = make_frame(session, plan, blocks.views, &times);
    const std::vector<int> to_root(blocks.views.size(), 0);
    // A PNG holds display colours, a third of the bytes of the radiance an EXR holds.
    TileLayer<Rgba8> display;
    if (output_.ends_with(".png")) {
      display = to_display(frame, session.threads(), options_.exposure);
      session.assembler().assemble(session.comm(), display, frame.owned, to_root);
    } else if (!output_.empty()) {
      session.assembler().assemble(session.comm(), frame.radiance, frame.owned, to_root);
    }
    if (!raw_.empty()) session.assembler().assemble(session.comm(), *frame.keys, frame.owned, to_root);
    const RunStats stats = gather_stats(session, plan, times, {watch.ms(), session.comm().bytes_sent() - sent_before});
    agree_on_failure(session.comm(), [&] {
      if (!speaks) return;
      if (!raw_.empty()) write_file_atomically(raw_, std::as_bytes(join_blocks(*frame.keys, blocks, 0).pixels()));
      if (output_.ends_with(".png")) {
        write_png(output_, join_blocks(display, blocks, 0));
      } else if (!output_.empty()) {
        write_image(output_, join_blocks(frame.radiance, blocks, 0), {{"hpr:scene", session.scene().name}});
      }
      if (!options_.stats.empty()) write_stats(options_.stats, stats);
    });
    if (speaks)
      log::info("{} triangles, {}x{} pixels, {} ranks: {:.1f} ms", session.scene().triangles, size.width, size.height,
                stats.ranks, stats.ms);
    return ExitCode::Done;
  }

  std::string source_;
  std::string output_;
  std::string size_ = "1280x720";
  std::string raw_;
  RenderOptions options_;
};

}  // namespace

std::unique_ptr<Command> make_render_command() {
  return std::make_unique<RenderCommand>();
}

}  // namespace hpr
