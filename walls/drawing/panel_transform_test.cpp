#include "walls/drawing/panel_transform.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// Every pixel tells where it came from.
Image<Rgba8> marked(Size size) {
  Image<Rgba8> image(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.at(x, y) = {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), 7, 255};
    }
  }
  return image;
}

Wall parsed(const std::string& text) {
  const WallReading reading = parse_wall(text, "t.toml");
  for (const WallFinding& finding : reading.findings) {
    if (finding.error || !finding.what.ends_with("overlaps no screen of its plane")) ADD_FAILURE() << finding.what;
  }
  return reading.wall;
}

/// Screens of 1 m x 1 m and 100 x 100 pixels at these places of their lower left corners.
Wall overlapped(const std::vector<glm::dvec2>& rects, const std::string& blend) {
  std::string text = "hpr_wall = 1\n[[surfaces]]\nscreens = [\n";
  for (std::size_t i = 0; i < rects.size(); ++i) {
    const auto [x, y] = std::pair(rects[i].x, rects[i].y);
    text += fmt::format(
        "{{ id = \"s{}\", pixels = [100, 100], edge_blend_m = {}, corners_m = {{ ll = [{}, {}, 0.0], lr = [{}, {}, "
        "0.0], ul = [{}, {}, 0.0] }} }},\n",
        i, blend, x, y, x + 1.0, y, x, y + 1.0);
  }
  return parsed(text + "]\n");
}

/// Weight of a screen at a point of the plane; 0 outside.
double weight_at(const Wall& wall, std::size_t screen, double u, double v) {
  const WallScreen& s = wall.screens[screen];
  const double x = (u - s.lower_left.x) * 100.0;
  const double y = (s.upper_left.y - v) * 100.0;
  if (x < 0.0 || y < 0.0 || x > 100.0 || y > 100.0) return 0.0;
  return BlendWeights(wall, screen).at(x, y);
}

TEST(PanelTransform, TurnsFirstAndThenMirrors) {
  Wall wall = load_wall("1x1@3x2");
  const Image<Rgba8> image = marked({3, 2});
  EXPECT_TRUE(PanelTransform(wall, 0).is_identity());
  EXPECT_EQ(PanelTransform(wall, 0).apply(image), image);
  wall.screens[0].mirror = Mirror::Horizontal;
  EXPECT_FALSE(PanelTransform(wall, 0).is_identity());
  EXPECT_EQ(PanelTransform(wall, 0).apply(image).at(2, 0), image.at(0, 0));
  EXPECT_EQ(PanelTransform(wall, 0).apply(image).at(2, 1), image.at(0, 1));
  wall.screens[0].mirror = Mirror::Vertical;
  EXPECT_EQ(PanelTransform(wall, 0).apply(image).at(0, 1), image.at(0, 0));
  EXPECT_EQ(PanelTransform(wall, 0).apply(image).at(2, 1), image.at(2, 0));
  wall.screens[0].rotate = 90;
  wall.screens[0].mirror = Mirror::Horizontal;
  const Image<Rgba8> panel = PanelTransform(wall, 0).apply(image);
  EXPECT_EQ(panel.size(), (Size{2, 3}));
  EXPECT_EQ(panel.size(), panel_pixels(wall.screens[0]));
  EXPECT_EQ(panel.at(0, 0), image.at(0, 0));  // turned it stands at (1, 0)
  EXPECT_EQ(panel.at(0, 2), image.at(2, 0));
}

TEST(PanelTransform, ColoursFollowTheFormulaPerChannel) {
  PanelColor color;
  EXPECT_NEAR(panel_level(color, 0, 0.2, 1.0), encode_srgb(0.2F), 1e-6);
  color.gain = {0.5, 1.0, 2.0};
  EXPECT_NEAR(panel_level(color, 0, 0.2, 1.0), encode_srgb(0.1F), 1e-6);
  EXPECT_NEAR(panel_level(color, 1, 0.2, 0.25), encode_srgb(0.05F), 1e-6);
  EXPECT_NEAR(panel_level(color, 2, 0.9, 1.0), 1.0, 1e-6);
  color.black = {0.1, 0.0, 0.0};
  EXPECT_NEAR(panel_level(color, 0, 0.0, 1.0), encode_srgb(0.1F), 1e-6);
  EXPECT_NEAR(panel_level(color, 0, 1.0, 1.0), encode_srgb(0.1F + 0.9F * 0.5F), 1e-6);
  color.gamma = {1.0, 2.0, 0.5};
  EXPECT_NEAR(panel_level(color, 1, 0.2, 1.0), std::sqrt(encode_srgb(0.2F)), 1e-6);
  EXPECT_NEAR(panel_level(color, 2, 0.1, 1.0), std::pow(encode_srgb(0.2F), 2.0), 1e-6);
}

TEST(PanelTransform, PanelsAreSentWhatTheFormulaSays) {
  Wall wall = load_wall("1x1@256x1");
  PanelColor& color = wall.screens.front().color;
  color.gain = {0.5, 1.0, 1.7};
  color.black = {0.1, 0.0, 0.02};
  color.gamma = {1.0, 2.0, 0.6};
  Image<Rgba8> ramp({256, 1});
  for (int x = 0; x < 256; ++x) {
    const auto level = static_cast<std::uint8_t>(x);
    ramp.at(x, 0) = {level, level, level, 255};
  }
  const Image<Rgba8> sent = PanelTransform(wall, 0).apply(ramp);
  for (int x = 0; x < 256; ++x) {
    const auto light = static_cast<double>(srgb_to_linear(static_cast<std::uint8_t>(x)));
    const auto wanted = [&](int channel) { return std::lround(255.0 * panel_level(color, channel, light, 1.0)); };
    EXPECT_EQ(sent.at(x, 0).r, wanted(0)) << x;
    EXPECT_EQ(sent.at(x, 0).g, wanted(1)) << x;
    EXPECT_EQ(sent.at(x, 0).b, wanted(2)) << x;
  }
}

TEST(PanelTransform, APanelWithPlainColoursIsSentTheSameBits) {
  const Wall wall = parsed(
      "hpr_wall = 1\n[[surfaces]]\n[surfaces.grid]\ncolumns = 1\nrows = 1\ntile_pixels = [256, 2]\ntile_size_m = "
      "[2.56, 0.02]\ncolour = { gamma = 1.0, gain = [1, 1, 1], black = 0 }\n");
  EXPECT_TRUE(PanelTransform(wall, 0).is_identity());
  const Image<Rgba8> image = marked({256, 2});
  Wall shaded = wall;
  shaded.screens[0].color.gain.b = 0.5;  // forces every channel through the tables
  const Image<Rgba8> panel = PanelTransform(shaded, 0).apply(image);
  for (int x = 0; x < 256; ++x) EXPECT_EQ(panel.at(x, 0).r, image.at(x, 0).r);
}

TEST(EdgeBlend, WeightsOfOverlappingScreensSumToOneInLinearLight) {
  // Two beside each other, four in a block, three over one point, and one turned on its side.
  const std::vector<std::vector<glm::dvec2>> layouts{
      {{0.0, 0.0}, {0.8, 0.0}},
      {{0.0, 0.0}, {0.8, 0.0}, {0.0, 0.7}, {0.8, 0.7}},
      {{0.0, 0.0}, {0.6, 0.1}, {0.3, 0.55}},
  };
  for (const char* const blend : {"\"auto\"", "{ auto = true, gamma = 2.2 }", "0.15", "{ left = 0.3, right = 0.1 }"}) {
    for (const auto& layout : layouts) {
      const Wall wall = overlapped(layout, blend);
      std::size_t shared = 0;
      for (int j = 0; j <= 40; ++j) {
        for (int i = 0; i <= 40; ++i) {
          const double u = 0.0473 * i;
          const double v = 0.0431 * j;
          double sum = 0.0;
          int covering = 0;
          for (std::size_t s = 0; s < layout.size(); ++s) {
            const glm::dvec2 p = layout[s];
            covering += u >= p.x && u <= p.x + 1.0 && v >= p.y && v <= p.y + 1.0 ? 1 : 0;
            sum += weight_at(wall, s, u, v);
          }
          shared += covering > 1 ? 1 : 0;
          if (covering > 0) {
            EXPECT_NEAR(sum, 1.0, 1e-12) << blend << " at " << u << ", " << v;
          }
        }
      }
      EXPECT_GT(shared, 50U);
    }
  }
}

TEST(EdgeBlend, FadesOverTheOverlapAndNowhereElse) {
  const Wall wall = overlapped({{0.0, 0.0}, {0.8, 0.0}}, "\"auto\"");
  EXPECT_EQ(weight_at(wall, 0, 0.5, 0.5), 1.0);
  EXPECT_EQ(weight_at(wall, 0, 0.0, 0.0), 1.0);
  EXPECT_NEAR(weight_at(wall, 0, 0.85, 0.5), 0.75, 1e-12);
  EXPECT_NEAR(weight_at(wall, 0, 0.9, 0.5), 0.5, 1e-12);
  EXPECT_NEAR(weight_at(wall, 1, 0.85, 0.5), 0.25, 1e-12);
  EXPECT_NEAR(weight_at(overlapped({{0.0, 0.0}, {0.8, 0.0}}, "{ auto = true, gamma = 2.0 }"), 1, 0.85, 0.5), 0.5 * 0.25,
              1e-12);
  // Alone it keeps its ramp, towards whatever lies beside the wall.
  EXPECT_NEAR(weight_at(overlapped({{0.0, 0.0}}, "0.2"), 0, 0.05, 0.5), 0.25, 1e-12);
  EXPECT_TRUE(BlendWeights(overlapped({{0.0, 0.0}}, "\"auto\""), 0).is_identity());
}

TEST(EdgeBlend, ThePicturesOfTwoProjectorsAddUpToTheFlatPicture) {
  const Wall wall = overlapped({{0.0, 0.0}, {0.8, 0.0}}, "{ auto = true, gamma = 1.8 }");
  const Image<Rgba8> gray({100, 100}, {180, 180, 180, 255});
  const Image<Rgba8> left = PanelTransform(wall, 0).apply(gray);
  const Image<Rgba8> right = PanelTransform(wall, 1).apply(gray);
  const double light = srgb_to_linear(180);
  for (int x = 80; x < 100; ++x) {
    const double sum = srgb_to_linear(left.at(x, 50).r) + srgb_to_linear(right.at(x - 80, 50).r);
    EXPECT_NEAR(sum, light, 0.01 * light) << x;  // each is rounded to one of 256 levels
  }
  EXPECT_LT(left.at(99, 50).r, 60);
  EXPECT_EQ(left.at(79, 50).r, 180);
}

TEST(EdgeBlend, ATurnedNeighbourFadesAtItsOwnEdges) {
  // The second one's right points up: what it fades on its left lies at its lower end.
  Wall wall = overlapped({{0.0, 0.0}, {0.0, 0.8}}, "\"auto\"");
  WallScreen& turned = wall.screens[1];
  turned.lower_left = {1.0, 0.8, 0.0};
  turned.lower_right = {1.0, 1.8, 0.0};
  turned.upper_left = {0.0, 0.8, 0.0};
  EXPECT_NEAR(BlendWeights(wall, 1).at(5.0, 50.0), 0.25, 1e-12);
  EXPECT_NEAR(BlendWeights(wall, 0).at(50.0, 15.0), 0.75, 1e-12);
  EXPECT_EQ(BlendWeights(wall, 1).at(50.0, 50.0), 1.0);
}

/// A panel that splits what it is sent shows each eye's half in full: nothing of one eye may reach the other's.
TEST(PanelTransform, TwoEyesPicturesAreMountedEachInItsPlace) {
  const auto wall_of = [](const std::string& mode, const std::string& mounting) {
    return parsed("hpr_wall = 1\nstereo = { mode = \"" + mode +
                  "\" }\nviewers = [{ ipd_m = 0.06 }]\n[[surfaces]]\nscreens = [{ id = \"s\", pixels = [8, 6], " +
                  mounting + ", corners_m = { ll = [0, 0, 0], lr = [0.8, 0, 0], ul = [0, 0.6, 0] } }]\n");
  };
  const Image<Rgba8> picture = marked({8, 6});
  const Wall beside = wall_of("side-by-side", "mirror = \"horizontal\"");
  const Image<Rgba8> mirrored_beside = PanelTransform(beside, 0).apply(picture);
  EXPECT_EQ(mirrored_beside.at(0, 0), picture.at(3, 0));
  EXPECT_EQ(mirrored_beside.at(4, 5), picture.at(7, 5));
  const Wall turned = wall_of("top-bottom", "rotate = 180");
  const Image<Rgba8> turned_above = PanelTransform(turned, 0).apply(picture);
  EXPECT_EQ(turned_above.at(0, 0), picture.at(7, 2));
  EXPECT_EQ(turned_above.at(0, 3), picture.at(7, 5));
  const Wall faded = wall_of("side-by-side", "edge_blend_m = { left = 0.4 }");
  const PanelTransform fades(faded, 0);
  const Image<Rgba8> white(Size{8, 6}, Rgba8{255, 255, 255, 255});
  const Image<Rgba8> shown = fades.apply(white);
  for (int x = 0; x < 4; ++x) EXPECT_EQ(shown.at(x, 0), shown.at(x + 4, 0)) << x;
  EXPECT_LT(shown.at(0, 0).r, shown.at(1, 0).r);
  EXPECT_EQ(shown.at(3, 0).r, 255);
  const WallReading refused = parse_wall(
      "hpr_wall = 1\nstereo = { mode = \"side-by-side\" }\nviewers = [{ ipd_m = 0.06 }]\n[[surfaces]]\nscreens = [{ id "
      "= "
      "\"s\", pixels = [8, 6], rotate = 90, corners_m = { ll = [0, 0, 0], lr = [0.8, 0, 0], ul = [0, 0.6, 0] } }]\n",
      "t.toml");
  ASSERT_FALSE(refused.findings.empty());
  EXPECT_NE(refused.findings.front().what.find("splits two eyes"), std::string::npos);
}

}  // namespace
}  // namespace hpr
