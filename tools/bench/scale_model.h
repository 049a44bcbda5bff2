#pragma once

#include <string>
#include <vector>

#include "app/doctor/doctor.h"
#include "cluster/transport/simulated_communicator.h"
#include "engine/balance/frame_model.h"
#include "tools/bench/bench_scale.h"

/// How frames would scale on a cluster that is not there: `hpr bench scale --simulate`. What a rank's work takes is
/// measured here, on one rank; links and hosts are modelled.
namespace hpr {

/// Frames of one wall by one distribution on so many ranks, the mean of its views.
struct ModelledScale {
  Size grid;
  int ranks = 1;
  int hosts = 1;
  FramePrediction frame;
  double speed_up = 1.0;  ///< against one rank
  FrameLimit limit;       ///< what most of the rest is lost to

  [[nodiscard]] double efficiency() const { return speed_up / ranks; }
};

struct ScaleModelReport {
  std::string command;  ///< that makes the same report again
  Machine machine;      ///< that work was measured on
  std::string input;
  Size size;  ///< pixels of a screen
  int sides = 0;
  SimulatedCluster cluster;
  MachineSpeeds measured;  ///< work of one rank alone; of a pixel the mean of the first wall's views
  bool by_rays = false;    ///< rays make the keys
  std::vector<ModelledScale> runs;
};

/// The speeds of a cluster's ranks: `measured` work, and the cluster's links between so many of its ranks.
[[nodiscard]] MachineSpeeds speeds_on(const SimulatedCluster& cluster, const MachineSpeeds& measured, int ranks);

/// Draws each wall on one rank as its camera sees it or, with `sides`, from so many sides of the scene; then models it
/// on 1, 2, 4 .. and all of the cluster's ranks, by every distribution.
[[nodiscard]] ScaleModelReport model_scale(const Globals& globals, const ScaleInput& input,
                                           const SimulatedCluster& cluster, int sides);

[[nodiscard]] std::string scale_model_table(const ScaleModelReport& report);
/// Schema hpr.bench-scale-model/1.
[[nodiscard]] std::string scale_model_json(const ScaleModelReport& report);
/// One line per run under a line of column names.
[[nodiscard]] std::string scale_model_csv(const ScaleModelReport& report);
/// One page, with a plot of the efficiency of each wall.
[[nodiscard]] std::string scale_model_html(const ScaleModelReport& report);

}  // namespace hpr
