#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "engine/balance/frame_model.h"

namespace hpr {

class Session;
struct FramePlan;
struct FrameSettings;
struct View;

/// How a frame's work is dealt, and why.
struct DistributionChoice {
  Distribution distribution = Distribution::SortFirst;
  std::string why;
  bool is_predicted = false;  ///< whether another view, or what light takes, may change it
  std::string speeds = {};    ///< by which it was predicted, for people
};

/// Collective. Of what the settings leave open: what the model of frames (predict_frame) expects to take least, by
/// speeds measured once in a session. A frame whose drawing cannot matter is not looked at: each rank draws its tiles.
/// `plan`: knows its layout, its rays and its primary. `current`: at work, with all that is built for it. Every choice
/// gives the same bits. Throws Error (Usage) where ranks hold parts of the scene and settings ask for more.
[[nodiscard]] DistributionChoice choose_distribution(Session& session, const FrameSettings& settings,
                                                     const FramePlan& plan, std::span<const View> views,
                                                     std::optional<Distribution> current = {});

/// The distribution that is expected to take least, but for a gain of less than kMinDistributionGain: then `current`,
/// for which Embree's scene is there, or the first candidate that is so near. With what each is expected to take.
struct PredictedChoice {
  Distribution distribution = Distribution::SortFirst;
  std::vector<FramePrediction> predictions;
};
[[nodiscard]] PredictedChoice choose_by_model(const FrameLoad& load, const MachineSpeeds& speeds, int ranks, int groups,
                                              std::optional<Distribution> current = {},
                                              std::span<const Distribution> candidates = kDistributions);

/// Less than this part of a frame is noise of the model.
inline constexpr double kMinDistributionGain = 0.1;

/// The speeds of a session's ranks, of rays as the frames before of this plan took them.
[[nodiscard]] MachineSpeeds speeds_of_frame(Session& session, const FramePlan& plan);
/// The load of a frame for predict_frame, as far as it is known: of light what tiles took before.
[[nodiscard]] FrameLoad load_of_frame(Session& session, const FramePlan& plan, const MachineSpeeds& speeds,
                                      std::span<const View> views);

}  // namespace hpr
