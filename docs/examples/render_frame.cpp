// Renders a frame with the engine alone: it links hpr::engine, and knows no command line, no JSON and no walls.
//
// usage: render_frame SCENE FILE.exr

#include "cluster/transport/local_communicator.h"
#include "engine/frame.h"
#include "engine/render_settings.h"
#include "engine/session.h"
#include "image/image_io.h"
#include "scene/load_scene.h"
#include "scene/view.h"

int main(int argc, char** argv) {
  using namespace hpr;
  if (argc != 3) return 2;
  run_local_ranks(1, [&](Communicator& comm) {
    Session session(comm, {}, [&] { return load_scene(argv[1]); });
    const RenderSettings settings = resolve({}, 1);
    const Camera camera = choose_camera(settings.camera, session.scene());
    const View view = make_view(camera, {320, 240}, session.scene().bounds);
    const FramePlan plan = plan_frame(session, settings.frame, std::span(&view, 1));
    const Frame frame = make_frame(session, plan, std::span(&view, 1));
    write_image(argv[2], to_image(frame.radiance, 0));
  });
  return 0;
}
