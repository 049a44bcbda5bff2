#include "walls/displays/web_hub.h"

#include <gtest/gtest.h>

#include "walls/config/wall_file.h"

namespace hpr {
namespace {

constexpr Rgba8 kRed{200, 0, 0, 255};
constexpr Rgba8 kGreen{0, 200, 0, 255};

class WebHubTest : public testing::Test {
 protected:
  /// One screen's picture, all of one color.
  void publish(WebHub& hub, std::uint64_t frame, std::size_t screen, const Rgba8& color) const {
    const Image<Rgba8> image(wall_.screens[screen].pixels, color);
    const std::vector<ScreenPicture> pictures{{screen, image}};
    hub.publish({frame, pictures});
  }

  const Wall wall_ = load_wall("2x1@16x8");
};

TEST_F(WebHubTest, AScreenHasNoPictureBeforeItsFirst) {
  WebHub hub(wall_);
  EXPECT_EQ(hub.picture(0), nullptr);
  publish(hub, 1, 0, kRed);
  EXPECT_NE(hub.picture(0), nullptr);
  EXPECT_NE(hub.picture(1), nullptr);
  EXPECT_EQ(hub.picture(2), nullptr);
}

TEST_F(WebHubTest, ScreensAFrameLacksKeepTheirPictures) {
  WebHub parts(wall_);
  publish(parts, 1, 0, kRed);
  publish(parts, 2, 1, kGreen);
  WebHub whole(wall_);
  const Image<Rgba8> left(wall_.screens[0].pixels, kRed);
  const Image<Rgba8> right(wall_.screens[1].pixels, kGreen);
  const std::vector<ScreenPicture> both{{0, left}, {1, right}};
  whole.publish({2, both});
  for (const std::size_t stream : {0U, 1U, 2U}) {
    ASSERT_NE(parts.picture(stream), nullptr);
    EXPECT_EQ(parts.picture(stream)->jpeg, whole.picture(stream)->jpeg) << "stream " << stream;
  }
}

TEST_F(WebHubTest, AFrameThatIsShownAgainWithAnotherPictureIsNews) {
  WebHub hub(wall_);
  publish(hub, 7, 0, kRed);
  const auto before = hub.picture(1);
  EXPECT_EQ(hub.picture(1), before);
  publish(hub, 7, 0, kGreen);
  EXPECT_EQ(hub.picture(1)->frame, 7U);
  EXPECT_NE(hub.picture(1)->jpeg, before->jpeg);
}

}  // namespace
}  // namespace hpr
