// Ranks that hold parts of a scene draw what ranks draw that hold all of it, also once it is changed.
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "compositing/assembly.h"
#include "core/error.h"
#include "core/progress.h"
#include "engine/frame_maker.h"
#include "engine/render_settings.h"
#include "engine/session.h"
#include "engine/settings_table.h"
#include "engine/wall/scene_edits.h"
#include "scene/load_scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

using namespace std::chrono_literals;
using Options = std::vector<std::pair<std::string, std::string>>;

RenderSettings settings_with(const Options& options) {
  RenderSettings settings;
  for (const auto& [name, value] : options) set_setting(settings, name, value);
  return resolve(settings, 1);
}

std::vector<View> screens_of(const Scene& scene) {
  const Camera camera = choose_camera({}, scene);
  return {make_view(camera, {100, 70}, scene.bounds), make_view(camera, {40, 60}, scene.bounds)};
}

void add_frame(Session& session, const RenderSettings& settings, std::vector<Rgb>& pixels) {
  FrameMaker maker(session, settings.frame, settings.sampling, screens_of(session.scene()), std::nullopt);
  Progress progress("none", "sample", 0);
  Frame* const frame = maker.make(screens_of(session.scene()), 0, progress);
  ASSERT_NE(frame, nullptr);
  const std::vector<int> to_root(maker.blocks().views.size(), 0);
  session.assembler().assemble(session.comm(), frame->radiance, frame->owned, to_root);
  if (session.rank() != 0) return;
  for (std::size_t screen = 0; screen < to_root.size(); ++screen) {
    const Image<Rgb> image = to_image(frame->radiance, screen);
    pixels.insert(pixels.end(), image.pixels().begin(), image.pixels().end());
  }
}

/// The bits of a frame, of one after a node moved, and of one without another node.
std::vector<Rgb> draw(int ranks, const std::string& scene, const Options& options) {
  std::vector<Rgb> pixels;
  run_local_ranks({.size = ranks, .hang_timeout = 60s, .disorder = 3}, [&](Communicator& comm) {
    const RenderSettings settings = settings_with(options);
    Session session(comm, {.threads = 1}, [&] {
      return load_scene(scene, settings, {}, {}, first_view(settings, {100, 70}));
    });
    EXPECT_EQ(is_shared_out(session.scene()), settings.frame.partitioned && ranks > 1);
    add_frame(session, settings, pixels);
    SceneEdits edits(session.scene());
    const auto change = [&] { session.change_scene([&](Scene& changed) { edits.apply(changed); }); };
    edits.move_by(edits.nodes().at(edits.nodes().size() / 2).name, {0.1, 0.2, 0.0});
    change();
    add_frame(session, settings, pixels);
    edits.hide(edits.nodes().front().name, true);
    change();
    add_frame(session, settings, pixels);
  });
  return pixels;
}

TEST(EditedParts, FramesHaveTheBitsOfAWholeScene) {
  const Options common{{"photons", "300"}, {"camera", "0"}};
  for (const char* const primary : {"rays", "raster"}) {
    for (const char* const scene : {"gen:gallery?s=1&n=2&k=2", "gen:asteroids?count=12&k=2"}) {
      Options options = common;
      if (std::string(scene).starts_with("gen:asteroids")) options = {{"passes", "auto"}};
      options.emplace_back("primary", primary);
      const std::vector<Rgb> expected = draw(1, scene, options);
      ASSERT_FALSE(expected.empty());
      options.emplace_back("data", "partitioned");
      for (const int ranks : {2, 3, 7}) {
        EXPECT_TRUE(draw(ranks, scene, options) == expected) << scene << ' ' << primary << ' ' << ranks;
      }
      options.emplace_back("distribute", "hybrid");
      EXPECT_TRUE(draw(4, scene, options) == expected) << scene << ' ' << primary << " islands";
      options.emplace_back("groups", "2");
      EXPECT_TRUE(draw(8, scene, options) == expected) << scene << ' ' << primary << " two islands";
    }
  }
}

TEST(EditedParts, WhatPartsCannotDrawIsRefused) {
  run_local_ranks({.size = 2, .hang_timeout = 60s}, [&](Communicator& comm) {
    const RenderSettings settings = settings_with({{"data", "partitioned"}});
    Session session(comm, {.threads = 1},
                    [&] { return load_scene("gen:asteroids?count=5", settings, {}, {}, first_view(settings)); });
    for (const char* const name : {"sort-first"}) {
      const RenderSettings other = settings_with({{"distribute", name}});
      try {
        (void)plan_frame(session, other.frame, screens_of(session.scene()));
        ADD_FAILURE() << name;
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ExitCode::Usage);
        EXPECT_EQ(error.hint(), "use --distribute sort-last, or load the scene again");
      }
    }
  });
}

TEST(EditedParts, IslandsOfOtherSizesAreRefused) {
  run_local_ranks({.size = 3, .hang_timeout = 60s}, [&](Communicator& comm) {
    const RenderSettings settings = settings_with({{"data", "partitioned"}, {"distribute", "hybrid"}, {"groups", "2"}});
    EXPECT_THROW(Session(comm, {.threads = 1},
                         [&] { return load_scene("gen:asteroids?count=5", settings, {}, {}, first_view(settings)); }),
                 Error);
  });
}

}  // namespace
}  // namespace hpr
