// Ranks that hold parts of a scene draw what ranks draw that hold all of it, also once it is changed.
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "core/progress.h"
#include "engine/settings/test_frames.h"
#include "engine/wall/scene_edits.h"
#include "scene/load_scene.h"
#include "scene/pages/part_pages.h"
#include "scene/partial_mesh.h"
#include "scene/view.h"

namespace hpr {
namespace {

using namespace std::chrono_literals;
using test::Options;
using test::settings_with;

std::vector<View> screens_of(const Scene& scene) {
  const Camera camera = choose_camera({}, scene);
  return {make_view(camera, {100, 70}, scene.bounds), make_view(camera, {40, 60}, scene.bounds)};
}

void add_frame(Session& session, const RenderSettings& settings, std::vector<Rgb>& pixels) {
  FrameMaker maker(session, settings.frame, settings.sampling, screens_of(session.scene()), std::nullopt);
  Progress progress("none", "sample", 0);
  Frame* const frame = maker.make(screens_of(session.scene()), 0, progress);
  ASSERT_NE(frame, nullptr);
  test::add_pixels(session, maker, *frame, frame->radiance, pixels);
}

/// Leaves each of so many ranks room for two thirds of its part of what ranks do not all hold.
void limit_to_pages(LoadedScene& loaded, int ranks) {
  if (!loaded.in_pages) return;
  std::uint64_t shared = 0;
  for (const Mesh& mesh : loaded.scene.meshes) shared += is_held_by_all(loaded.scene, mesh) ? 0 : memory_of(mesh);
  const std::uint64_t held_by_all = whole_memory_of(loaded.scene) - shared;
  loaded.memory_limit = held_by_all + 2 * shared / (3 * static_cast<std::uint64_t>(ranks)) + 4096;
}

/// The bits of a frame, of one after a node moved, and of one without another node.
std::vector<Rgb> draw(int ranks, const std::string& scene, const Options& options) {
  std::vector<Rgb> pixels;
  run_local_ranks({.size = ranks, .hang_timeout = 60s, .disorder = 3}, [&](Communicator& comm) {
    const RenderSettings settings = settings_with(options);
    Session session(comm, {.threads = 1}, [&] {
      LoadedScene loaded = load_scene(scene, settings, {}, {}, first_view(settings, {100, 70}));
      limit_to_pages(loaded, ranks);
      return loaded;
    });
    EXPECT_EQ(session.scene().part_pages != nullptr, settings.frame.data == SceneData::Paged);
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

/// A scene, and who makes its keys.
class EditedPartsTest : public testing::TestWithParam<std::tuple<std::string, std::string>> {
 protected:
  [[nodiscard]] static Options options_with(const Options& more) {
    const auto& [scene, primary] = GetParam();
    Options options{{"primary", primary}};
    // The gallery has cameras and light of its own; the asteroids are framed, also those that were moved.
    if (scene.starts_with("gen:gallery")) options.insert(options.end(), {{"photons", "300"}, {"camera", "0"}});
    options.insert(options.end(), more.begin(), more.end());
    return options;
  }
};

TEST_P(EditedPartsTest, FramesHaveTheBitsOfAWholeScene) {
  const std::string& scene = std::get<0>(GetParam());
  const std::vector<Rgb> expected = draw(1, scene, options_with({}));
  ASSERT_FALSE(expected.empty());
  for (const int ranks : {2, 7}) {
    EXPECT_TRUE(draw(ranks, scene, options_with({{"data", "partitioned"}})) == expected) << ranks;
  }
}

TEST_P(EditedPartsTest, PagesOfAPartAreDrawnOneByOne) {
  const std::string& scene = std::get<0>(GetParam());
  const std::vector<Rgb> expected = draw(1, scene, options_with({}));
  for (const int ranks : {1, 3}) {
    EXPECT_TRUE(draw(ranks, scene, options_with({{"data", "paged"}})) == expected) << ranks;
  }
}

TEST_P(EditedPartsTest, IslandsDrawThemToo) {
  const std::string& scene = std::get<0>(GetParam());
  const std::vector<Rgb> expected = draw(1, scene, options_with({}));
  const Options islands{{"data", "partitioned"}, {"distribute", "hybrid"}};
  EXPECT_TRUE(draw(4, scene, options_with(islands)) == expected);
  EXPECT_TRUE(draw(3, scene, options_with(islands)) == expected) << "one island";
  EXPECT_TRUE(draw(2, scene, options_with({{"data", "partitioned"}, {"distribute", "hybrid"}, {"groups", "9"}})) ==
              expected)
      << "islands of one rank";
}

TEST_P(EditedPartsTest, SortMiddleSendsTrianglesOfParts) {
  const auto& [scene, primary] = GetParam();
  if (primary != "raster") return;  // rays meet no triangles that are sent
  const Options sends{{"data", "partitioned"}, {"distribute", "sort-middle"}};
  EXPECT_TRUE(draw(3, scene, options_with(sends)) == draw(1, scene, options_with({})));
}

INSTANTIATE_TEST_SUITE_P(Scenes, EditedPartsTest,
                         testing::Combine(testing::Values("gen:gallery?s=1&n=2&k=2", "gen:asteroids?count=12&k=2"),
                                          testing::Values("rays", "raster")),
                         [](const auto& named) {
                           return std::string(std::get<0>(named.param).starts_with("gen:gallery") ? "Gallery"
                                                                                                  : "Asteroids") +
                                  (std::get<1>(named.param) == "rays" ? "ByRays" : "ByOpenGl");
                         });

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

TEST(EditedParts, TilesAreNotDrawnWholeByAnotherRank) {
  run_local_ranks({.size = 2, .hang_timeout = 60s}, [&](Communicator& comm) {
    const RenderSettings settings = settings_with({{"data", "partitioned"}});
    Session session(comm, {.threads = 1},
                    [&] { return load_scene("gen:asteroids?count=5", settings, {}, {}, first_view(settings)); });
    ASSERT_TRUE(is_shared_out(session.scene()));
    const RenderSettings verified = settings_with({{"verify", "10"}});
    EXPECT_THROW((void)plan_frame(session, verified.frame, screens_of(session.scene())), Error);
  });
}

/// One rank after the other leaves its group alone: whoever stays waits for it where they shared memory.
TEST(EditedParts, GroupsMayChange) {
  run_local_ranks({.size = 5, .hang_timeout = 60s}, [&](Communicator& comm) {
    const auto hybrid = [](const char* groups) {
      return settings_with({{"distribute", "hybrid"}, {"groups", groups}, {"primary", "rays"}, {"passes", "none"}});
    };
    Session session(comm, {.threads = 1},
                    [&] { return load_scene("gen:asteroids?count=5", hybrid("2"), {}, {}, first_view(hybrid("2"))); });
    std::vector<Rgb> first;
    add_frame(session, hybrid("2"), first);
    for (const char* const groups : {"3", "1", "5", "2"}) {
      std::vector<Rgb> pixels;
      add_frame(session, hybrid(groups), pixels);
      EXPECT_TRUE(pixels == first) << groups;
    }
  });
}

TEST(EditedParts, HoldersOfTheSamePartsMayChange) {
  run_local_ranks({.size = 4, .hang_timeout = 60s}, [&](Communicator& comm) {
    const auto with = [](const char* distribution, const char* groups) {
      Options options{{"distribute", distribution}, {"data", "partitioned"}, {"primary", "rays"}, {"spp", "1"}};
      if (std::string(groups) != "") options.emplace_back("groups", groups);
      return settings_with(options);
    };
    // Loaded whole; a box of one chunk, of which the parts of some ranks are the same in each of these.
    const RenderSettings whole = settings_with({});
    Session session(comm, {.threads = 1}, [&] { return load_scene("gen:cornell", whole, {}, {}, first_view(whole)); });
    std::vector<Rgb> first;
    add_frame(session, with("sort-last", ""), first);
    std::vector<Rgb> second;
    add_frame(session, with("hybrid", "2"), second);
    std::vector<Rgb> third;
    add_frame(session, with("sort-last", ""), third);
    EXPECT_TRUE(second == first && third == first);
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
