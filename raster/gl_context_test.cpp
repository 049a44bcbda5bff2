#include "raster/gl_context.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <string>

#include "core/error.h"
#include "raster/gl.h"
#include "raster/raster_test_scenes.h"

namespace hpr {
namespace {

TEST(GlContext, EgLAndOsMesaDrawTheSameKeysInTurn) {
  const std::unique_ptr<GlContext> egl = make_gl_context({.backend = "egl"});
  const std::unique_ptr<GlContext> osmesa = make_gl_context({.backend = "osmesa"});
  const Scene scene = test::mixed_scene();
  const View view = test::perspective_view({321, 211});
  const std::array objects{test::all_of(scene)};
  Rasterizer by_egl(*egl, scene, objects, 1);
  Rasterizer by_osmesa(*osmesa, scene, objects, 1);
  for (int turn = 0; turn < 3; ++turn) {
    TileLayer<Key> first(FrameLayout({view.size()}));
    TileLayer<Key> second(FrameLayout({view.size()}));
    by_egl.draw(view, 0, std::array{view.block}, first);
    by_osmesa.draw(view, 0, std::array{view.block}, second);
    EXPECT_GT(test::covered(to_image(first, 0)), 30000U);
    EXPECT_TRUE(to_image(first, 0) == to_image(second, 0));
  }
}

TEST(GlContext, ContextsSayWhatTheyAre) {
  for (const std::string& backend : all_gl_backends()) {
    const std::unique_ptr<GlContext> context = make_gl_context({.backend = backend});
    EXPECT_EQ(context->name(), backend);
    EXPECT_NE(context->description().find("OpenGL 4."), std::string::npos) << context->description();
    EXPECT_EQ(context->software(), context->description().find("llvmpipe") != std::string::npos);
  }
}

TEST(GlContext, AutoTakesTheFirstThatWorks) {
  EXPECT_EQ(make_gl_context({})->name(), "egl");
}

TEST(GlContext, AnUnknownBackendIsAUsageErrorWithTheChoices) {
  try {
    const auto context = make_gl_context({.backend = "osmessa"});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("osmesa"), std::string::npos) << error.hint();
  }
}

TEST(GlContext, ADeviceThatIsNotThereIsNamed) {
  for (const std::string backend : {"egl", "auto"}) {
    try {
      const auto context = make_gl_context({.backend = backend, .device = 63});
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::NoDevice);
      EXPECT_NE(std::string(error.what()).find("63"), std::string::npos) << error.what();
      EXPECT_NE(error.hint().find("EGL lists"), std::string::npos) << error.hint();
    }
  }
}

TEST(GlContext, AnEglDeviceByIndexDrawsTheSame) {
  const std::unique_ptr<GlContext> device = make_gl_context({.backend = "egl", .device = 0});
  if (!device->software()) GTEST_SKIP() << "device 0 is " << device->description();
  EXPECT_EQ(raster_fingerprint(*device), raster_fingerprint(*make_gl_context({.backend = "osmesa"})));
}

TEST(GlContext, AGlErrorIsReportedOnceWithWhereItArose) {
  const std::unique_ptr<GlContext> context = make_gl_context({});
  context->gl().Enable(GL_TRIANGLES);
  try {
    check_gl(context->gl(), "enabling nonsense");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::NoDevice);
    EXPECT_NE(std::string(error.what()).find("GL_INVALID_ENUM while enabling nonsense"), std::string::npos)
        << error.what();
  }
  EXPECT_NO_THROW(check_gl(context->gl(), "nothing"));
}

/// What this very program prints for PrintsTheFingerprint with `threads` threads; they are read once per process.
std::string fingerprint_with(int threads, const std::string& backend) {
  const std::string command = fmt::format(
      "HPR_TEST_THREADS={} HPR_TEST_BACKEND={} {} --gtest_also_run_disabled_tests "
      "--gtest_filter=GlContext.DISABLED_PrintsTheFingerprint",
      threads, backend, std::filesystem::read_symlink("/proc/self/exe").string());
  std::FILE* const pipe = popen(command.c_str(), "r");
  std::string output;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe) != nullptr) output += buffer.data();
  pclose(pipe);
  const std::size_t at = output.find("fingerprint ");
  return at == std::string::npos ? output : output.substr(at, 28);
}

TEST(GlContext, DISABLED_PrintsTheFingerprint) {
  const std::unique_ptr<GlContext> context = make_gl_context(
      {.backend = std::getenv("HPR_TEST_BACKEND"), .threads = std::atoi(std::getenv("HPR_TEST_THREADS"))});
  std::printf("fingerprint %016lx\n", static_cast<unsigned long>(raster_fingerprint(*context)));
}

TEST(GlContext, ThreadsAndBackendsDoNotChangeTheFingerprint) {
  const std::string one = fingerprint_with(1, "egl");
  EXPECT_EQ(one.size(), 28U) << one;
  EXPECT_EQ(one, fingerprint_with(2, "egl"));
  EXPECT_EQ(one, fingerprint_with(5, "osmesa"));
}

}  // namespace
}  // namespace hpr
