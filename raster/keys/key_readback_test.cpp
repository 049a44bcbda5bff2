#include "raster/keys/key_readback.h"

#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "raster/raster_test_scenes.h"

namespace hpr {
namespace {

using namespace test;

class KeyReadbackTest : public testing::TestWithParam<std::tuple<std::string, KeyRoute>> {
 protected:
  /// Two parts of a view, drawn one after the other onto what `layer` holds.
  void draw(const Scene& scene, const View& view, std::optional<KeyRoute> route, TileLayer<Key>& layer,
            int threads = 1) {
    Rasterizer rasterizer(*context_, scene, std::array{all_of(scene)}, threads, {.route = route});
    const Size size = view.size();
    rasterizer.draw(view, 0, std::array{Rect{3, 5, 150, size.height}, Rect{140, 0, size.width, 77}}, layer);
  }

  std::unique_ptr<GlContext> context_ = make_gl_context({.backend = std::get<0>(GetParam())});
  KeyRoute route_ = std::get<1>(GetParam());
};

INSTANTIATE_TEST_SUITE_P(Routes, KeyReadbackTest,
                         testing::Combine(testing::ValuesIn(all_gl_backends()), testing::ValuesIn(all_key_routes())),
                         [](const auto& each) {
                           return std::get<0>(each.param) + "_" + std::string(route_name(std::get<1>(each.param)));
                         });

TEST_P(KeyReadbackTest, BringsEveryPixelToWhereItIs) {
  constexpr Size kView{330, 140};
  constexpr Rect kPart{70, 5, 321, 137};
  const GlFunctions& gl = context_->gl();
  KeyTarget target(*context_);
  const std::unique_ptr<KeyReadback> readback = make_key_readback(route_, *context_);
  // What stands around the part is none of its keys.
  constexpr std::array<GLuint, 4> kOtherWord{7, 0, 0, 0};
  constexpr GLfloat kOtherDepth = 0.5F;
  target.begin(kView, {0, 0, kView.width, kView.height});
  gl.ClearBufferfv(GL_DEPTH, 0, &kOtherDepth);
  gl.ClearBufferuiv(GL_COLOR, 0, kOtherWord.data());
  target.begin(kView, kPart);
  TileLayer<Key> expected(FrameLayout({kView}));
  // Cells of odd sizes over some of the part; one tile of it stays empty.
  for (int y = 5; y + 9 <= 137; y += 11) {
    for (int x = 70; x + 13 <= 321; x += 17) {
      if (x + 13 > 192 && x < 256 && y < 64) continue;
      const float depth = static_cast<float>(1 + (x + 3 * y) % 1023) / 1024.0F;  // exact, even cleared by a quad
      const std::array<GLuint, 4> word{0xFFFFFFFFU - static_cast<GLuint>(x * y), 0, 0, 0};
      gl.Scissor(x, kView.height - (y + 9), 13, 9);
      gl.ClearBufferfv(GL_DEPTH, 0, &depth);
      gl.ClearBufferuiv(GL_COLOR, 0, word.data());
      for (int row = y; row < y + 9; ++row) {
        for (int column = x; column < x + 13; ++column) {
          expected.at(0, column, row) = make_key(depth, static_cast<std::uint32_t>(x * y));
          expected.set_active(expected.layout().tile_at(0, column, row));
        }
      }
    }
  }
  readback->start(target, kView, kPart);
  TileLayer<Key> layer(expected.layout());
  pack_keys(std::array{readback->finish()}, kPart, 0, layer, 1);
  check_gl(gl, "testing");
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) EXPECT_EQ(layer.active(tile), expected.active(tile)) << tile;
  EXPECT_FALSE(layer.active(3));
  for (int y = 0; y < kView.height; ++y) {
    for (int x = 0; x < kView.width; ++x) ASSERT_EQ(layer.at(0, x, y), expected.at(0, x, y)) << x << ' ' << y;
  }
}

TEST_P(KeyReadbackTest, HasTheSameKeysAndTilesAsOthersInAllDepthFormats) {
  const Scene scene = mixed_scene();
  for (const Size size : {Size{321, 211}, Size{192, 128}}) {
    const View view = perspective_view(size, {0.25, 0.125, 6.0});  // so far that some tiles stay empty
    for (const DepthFormat format : {DepthFormat::Float32, DepthFormat::Bits24, DepthFormat::Bits16}) {
      TileLayer<Key> expected(FrameLayout({size}));
      TileLayer<Key> layer(FrameLayout({size}));
      expected.set_depth_format(format);
      layer.set_depth_format(format);
      draw(scene, view, KeyRoute::Pixels, expected);
      draw(scene, view, route_, layer);
      EXPECT_GT(covered(to_image(expected, 0)), 5000U);
      EXPECT_TRUE(to_image(layer, 0) == to_image(expected, 0)) << lost_bits(format);
      for (std::size_t tile = 0; tile < layer.tiles(); ++tile) EXPECT_EQ(layer.active(tile), expected.active(tile));
    }
  }
}

TEST_P(KeyReadbackTest, MergesWithWhatTilesHold) {
  const Scene scene = mixed_scene();
  Scene other = mixed_scene();
  other.instances.erase(other.instances.begin(), other.instances.begin() + 2);
  finish_scene(other);
  const View view = perspective_view({300, 200});
  TileLayer<Key> layer(FrameLayout({view.size()}));
  TileLayer<Key> first(layer.layout());
  TileLayer<Key> second(layer.layout());
  draw(scene, view, KeyRoute::Pixels, first);
  draw(other, view, KeyRoute::Pixels, second);
  draw(scene, view, route_, layer);
  draw(other, view, route_, layer);
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 300; ++x) ASSERT_EQ(layer.at(0, x, y), std::max(first.at(0, x, y), second.at(0, x, y)));
  }
}

TEST_P(KeyReadbackTest, SeveralContextsGiveTheSameKeys) {
  Scene scene;
  scene.meshes = {waves(300)};
  scene.instances = {placed(0, {0.0, 0.0, 0.0}, 0.4, 1.5)};
  finish_scene(scene);
  const View view = perspective_view({300, 200});
  TileLayer<Key> expected(FrameLayout({view.size()}));
  TileLayer<Key> layer(FrameLayout({view.size()}));
  draw(scene, view, KeyRoute::Pixels, expected);
  draw(scene, view, route_, layer, 3);
  EXPECT_TRUE(to_image(layer, 0) == to_image(expected, 0));
}

TEST_P(KeyReadbackTest, AViewOfMoreTilesThanShadersReachAtOnceIsReadWhole) {
  const Scene scene = mixed_scene();
  const View view = perspective_view({kRasterLimit, 193});
  TileLayer<Key> expected(FrameLayout({view.size()}));
  TileLayer<Key> layer(FrameLayout({view.size()}));
  for (const auto& [route, into] : {std::pair{KeyRoute::Pixels, &expected}, std::pair{route_, &layer}}) {
    Rasterizer rasterizer(*context_, scene, std::array{all_of(scene)}, 1, {.route = route});
    rasterizer.draw(view, 0, std::array{view.block}, *into);
  }
  EXPECT_TRUE(to_image(layer, 0) == to_image(expected, 0));
}

/// A software context in a GPU's place: one context draws, and everything is asked for at once.
class HardwareContext final : public GlContext {
 public:
  explicit HardwareContext(GlContext& context) : context_(context) {}
  [[nodiscard]] std::string_view name() const override { return context_.name(); }
  [[nodiscard]] std::string description() const override { return context_.description(); }
  [[nodiscard]] bool software() const override { return false; }
  void make_current() override { context_.make_current(); }
  void release() override { context_.release(); }
  [[nodiscard]] const GlFunctions& gl() const override { return context_.gl(); }

 private:
  GlContext& context_;
};

TEST(KeyRoutes, AGpuTakesTheShaderAndGivesTheKeysOfASoftwareRenderer) {
  const std::unique_ptr<GlContext> context = make_gl_context({.backend = "osmesa"});
  HardwareContext hardware(*context);
  EXPECT_EQ(fastest_route(*context), KeyRoute::Pixels);
  EXPECT_EQ(fastest_route(hardware), KeyRoute::Shader);
  const Scene scene = mixed_scene();
  const View view = perspective_view({300, 200});
  const Image<Key> expected = draw_all(*context, scene, view);
  for (const KeyRoute route : all_key_routes()) {
    TileLayer<Key> layer(FrameLayout({view.size()}));
    Rasterizer rasterizer(hardware, scene, std::array{all_of(scene)}, 2, {.route = route});
    for (int turn = 0; turn < 2; ++turn) rasterizer.draw(view, 0, std::array{view.block}, layer);
    EXPECT_TRUE(to_image(layer, 0) == expected) << route_name(route);
  }
}

/// A context that is not there: its waits end as they are set to.
class WaitingContext final : public GlContext {
 public:
  explicit WaitingContext(PFNGLCLIENTWAITSYNCPROC wait) {
    gl_.FenceSync = [](GLenum, GLbitfield) -> GLsync { return nullptr; };
    gl_.DeleteSync = [](GLsync) {};
    gl_.ClientWaitSync = wait;
  }
  [[nodiscard]] std::string_view name() const override { return "none"; }
  [[nodiscard]] std::string description() const override { return "none"; }
  [[nodiscard]] bool software() const override { return true; }
  void make_current() override {}
  void release() override {}
  [[nodiscard]] const GlFunctions& gl() const override { return gl_; }

 private:
  GlFunctions gl_;
};

ExitCode code_of_wait(PFNGLCLIENTWAITSYNCPROC wait) {
  WaitingContext context(wait);
  const GlFence fence(context);
  try {
    fence.wait("drawing");
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("while drawing"), std::string::npos) << error.what();
    return error.code();
  }
  return ExitCode::Done;
}

TEST(GlFence, AWaitEndsWithinItsLimitAndSaysWhatItWaitedFor) {
  EXPECT_EQ(code_of_wait([](GLsync, GLbitfield, GLuint64) -> GLenum { return GL_CONDITION_SATISFIED; }),
            ExitCode::Done);
  EXPECT_EQ(code_of_wait([](GLsync, GLbitfield, GLuint64 limit_ns) -> GLenum {
              return limit_ns == 30'000'000'000U ? GL_TIMEOUT_EXPIRED : GL_ALREADY_SIGNALED;
            }),
            ExitCode::Hang);
  EXPECT_EQ(code_of_wait([](GLsync, GLbitfield, GLuint64) -> GLenum { return GL_WAIT_FAILED; }), ExitCode::NoDevice);
}

}  // namespace
}  // namespace hpr
