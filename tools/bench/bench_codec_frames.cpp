#include "tools/bench/bench_codec_frames.h"

#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "app/options/render_options.h"
#include "cluster/transport/local_communicator.h"
#include "core/progress.h"
#include "engine/frame_maker.h"
#include "engine/output.h"
#include "engine/session.h"

namespace hpr {
namespace {

constexpr double kTurn = 0.25 * std::numbers::pi / 180.0;

Camera turned(Camera camera, int steps) {
  camera.axes = glm::dmat3(glm::rotate(glm::dmat4(1.0), steps * kTurn, camera.axes[1])) * camera.axes;
  return camera;
}

}  // namespace

CodecFrames draw_codec_frames(const std::string& scene, Size size, int count, const Globals& globals) {
  CodecFrames frames;
  frames.scene = scene;
  const RenderSettings settings = resolve({}, globals.seed);
  run_local_ranks(1, [&](Communicator& comm) {
    Session session(comm, globals.session(), [&] { return load_scene(scene, settings, globals); });
    const Camera camera = choose_camera(settings.camera, session.scene());
    const auto seen = [&](int steps) { return make_view(turned(camera, steps), size, session.scene().bounds); };
    const View first = seen(0);
    FrameMaker maker(session, settings.frame, settings.sampling, std::span(&first, 1), std::nullopt);
    prepare(session, maker.plan());
    Progress progress(globals.progress, scene + ": frame", static_cast<std::size_t>(2 * count));
    Progress silent("none", "sample", 0);
    const auto draw = [&](const View& view, std::uint64_t number) {
      Frame& frame = maker.make(std::span(&view, 1), number, silent);
      std::vector<Image<Rgba8>> pictures = bring_to_screens(session, frame, maker.blocks(), {{size}, {0}});
      progress.step("");
      return std::move(pictures.front());
    };
    for (int i = 0; i < count; ++i) frames.turning.push_back(draw(seen(i), static_cast<std::uint64_t>(i)));
    for (int i = 0; i < count; ++i) frames.standing.push_back(draw(first, static_cast<std::uint64_t>(i)));
  });
  return frames;
}

}  // namespace hpr
