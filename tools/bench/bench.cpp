#include "tools/bench/bench.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>
#include <numbers>
#include <span>

#include "app/command.h"
#include "tools/report/table.h"

namespace hpr {

// Every subcommand, in the order `hpr bench --help` lists them. Each stands in a file of its own, bench_NAME.cpp, which
// defines make_bench_NAME_command().
#define HPR_FOR_EACH_BENCH(visit) visit(raster) visit(net) visit(rays) visit(codec) visit(scale) visit(frame)

#define HPR_DECLARE_BENCH(name) std::unique_ptr<Command> make_bench_##name##_command();
#define HPR_MAKE_BENCH(name) all.push_back(make_bench_##name##_command());

HPR_FOR_EACH_BENCH(HPR_DECLARE_BENCH)

namespace {

/// Our figure beside a floor's or a peer's, as a ratio of speeds: 1 is equal, more is faster (docs/commands.md).
class BenchCommand final : public CommandGroup {
 public:
  BenchCommand() : CommandGroup("bench", "our speed beside a floor's or a peer's, as ratios") {}
  [[nodiscard]] std::vector<std::unique_ptr<Command>> subcommands() const override {
    std::vector<std::unique_ptr<Command>> all;
    HPR_FOR_EACH_BENCH(HPR_MAKE_BENCH)
    return all;
  }
};

/// displaced_sphere of about so many triangles.
Mesh sphere_of(std::uint64_t triangles) {
  const auto side = static_cast<std::uint32_t>(std::lround(std::sqrt(0.5 * static_cast<double>(triangles))));
  return displaced_sphere(std::max(side, 4U) + 1, std::max(side, 4U));
}

}  // namespace

std::unique_ptr<Command> make_bench_command() {
  return std::make_unique<BenchCommand>();
}

void print_bench(const std::vector<BenchRow>& rows, const std::string& machine, bool json) {
  const auto known = [](double BenchRow::*member) {
    return [member](const BenchRow& row) { return row.floor > 0.0 ? Json(row.*member) : Json(); };
  };
  const std::vector<Column<BenchRow>> columns{
      field<BenchRow>("name", &BenchRow::name, {.align = Align::Left, .width = 44}),
      field<BenchRow>("ours", &BenchRow::ours, {.title = "ours", .format = "{:.2f}", .width = 10}),
      {"floor", known(&BenchRow::floor), {.title = "floor", .format = "{:.2f}", .width = 10}},
      field<BenchRow>("unit", &BenchRow::unit, {.align = Align::Left, .width = 6}),
      {"ratio", known(&BenchRow::ratio), {.title = "ratio", .format = "{:.2f}", .width = 6}}};
  const Table table(columns, std::span<const BenchRow>(rows));
  if (!json) {
    fmt::print("{}", table.text({"name", "ours", "floor", "unit", "ratio"}));
    return;
  }
  const Json document{{"schema", "hpr.bench/1"}, {"machine", machine}, {"commit", kCommit}, {"rows", table.json()}};
  fmt::print("{}\n", document.dump(2));
}

Mesh displaced_sphere(std::uint32_t rows, std::uint32_t columns) {
  Mesh mesh;
  for (std::uint32_t row = 0; row <= rows; ++row) {
    for (std::uint32_t column = 0; column <= columns; ++column) {
      const double theta = std::numbers::pi * row / rows;
      const double phi = 2.0 * std::numbers::pi * column / columns;
      const glm::dvec3 direction(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi));
      const double radius = 1.0 + 0.1 * std::sin(7.0 * phi) * std::sin(9.0 * theta);
      mesh.positions.emplace_back(radius * direction);
      mesh.normals.emplace_back(direction);
    }
  }
  for (std::uint32_t row = 0; row < rows; ++row) {
    for (std::uint32_t column = 0; column < columns; ++column) {
      const std::uint32_t corner = row * (columns + 1) + column;
      const std::uint32_t below = corner + columns + 1;
      if (row > 0) mesh.triangles.emplace_back(corner, corner + 1, below);
      if (row + 1 < rows) mesh.triangles.emplace_back(corner + 1, below + 1, below);
    }
  }
  return mesh;
}

Scene ray_bench_scene(std::uint64_t triangles) {
  constexpr int kColumns = 20;
  constexpr int kRows = 10;
  Scene scene;
  scene.name = "ray bench";
  scene.meshes = {sphere_of(triangles), sphere_of(triangles / 50), {}};
  Mesh& floor = scene.meshes.back();
  floor.positions = {{-8, -1.2F, 8}, {8, -1.2F, 8}, {8, -1.2F, -8}, {-8, -1.2F, -8}};
  floor.normals.assign(4, {0.0F, 1.0F, 0.0F});
  floor.triangles = {{0, 1, 2}, {0, 2, 3}};
  scene.instances = {{0, glm::dmat4(1.0), 0}, {2, glm::dmat4(1.0), 0}};
  for (int i = 0; i < kColumns * kRows; ++i) {
    const int row = i / kColumns;
    const double x = 0.7 * (i % kColumns - 0.5 * (kColumns - 1));
    const double z = 1.5 - 0.8 * row;
    const glm::dmat4 placed = glm::translate(glm::dmat4(1.0), {x, -1.0, z});
    scene.instances.push_back({1, glm::scale(glm::rotate(placed, 0.5 * i, {0.6, 0.8, 0.0}), glm::dvec3(0.2)), 0});
  }
  Light& light = scene.lights.emplace_back();
  light.position = {3.0, 5.0, 4.0};
  finish_scene(scene);
  return scene;
}

}  // namespace hpr
