#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "rt/passes/pass.h"
#include "rt/passes/path_vertex.h"

namespace hpr {

/// The surface that a place of the screen shows: a sample of a G-buffer.
struct SurfaceFeature {
  bool is_surface = false;  ///< else the background
  std::uint32_t material = 0;
  glm::vec3 position{0.0F};  ///< from the eye, metres
  glm::vec3 normal{0.0F};    ///< interpolated
};

[[nodiscard]] SurfaceFeature feature_at(const SurfacePoint& point, const glm::dvec3& eye);

/// How far one place may lie off the other's tangent plane, in distances between the two, for the two to be coplanar.
inline constexpr float kMaxBend = 0.5F;

/// The squared distance from a place within which another counts as near in the view, metres squared.
[[nodiscard]] float max_distance2(const View& view, const glm::vec3& position);

/// Whether both show one material, at places within max_distance2.
[[nodiscard]] bool is_within_depth(const View& view, const SurfaceFeature& first, const SurfaceFeature& second);

/// Whether is_within_depth holds and the second place lies near the tangent plane of the first one (kMaxBend).
[[nodiscard]] bool is_coplanar(const View& view, const SurfaceFeature& first, const SurfaceFeature& second);

/// Whether a silhouette edge lies between the two: another material, a sharp turn or a jump.
[[nodiscard]] bool is_silhouette(const View& view, const SurfaceFeature& a, const SurfaceFeature& b);

/// The job's view, not jittered.
[[nodiscard]] View unjittered(const TileJob& job);

/// The ray from the eye through a place of a pixel of the tile, from its centre. `view`: not jittered.
[[nodiscard]] RayRequest ray_through(View& view, const TileJob& job, std::uint32_t pixel, const glm::vec2& position);

/// Traces buffers.requests, which start at the eye: sets buffers.hits.
void trace_primary_rays(const LightContext& context, RayBuffers& buffers, Coherence coherence = Coherence::Low);

/// Traces buffers.requests, which start at the eye: sets the feature that each of them meets.
void trace_features(const LightContext& context, RayBuffers& buffers, const glm::dvec3& eye,
                    std::vector<SurfaceFeature>& seen, Coherence coherence = Coherence::Low);

/// A feature that is known at a place of a pixel.
struct KnownFeature {
  glm::vec2 position{0.0F};   ///< from the pixel's centre
  std::uint32_t feature = 0;  ///< its number
};

/// The silhouette edges of a tile, between corners of its pixels that show different features: a ray is traced through
/// every corner. Where one edge goes through a pixel, how it does is found by bisection: on the pixel's edges, and how
/// far it bends.
class SilhouetteEdges {
 public:
  /// A pixel that an edge crosses.
  struct Pixel {
    std::uint32_t pixel = 0;  ///< of the tile
    /// Whether one edge goes through that is about a parabola: then there are two sides.
    bool has_sides = false;
    glm::vec2 start{0.0F};                 ///< of the edge in the pixel, from the pixel's centre, pixels
    glm::vec2 chord{0.0F};                 ///< from there to its end
    glm::vec2 to_left{0.0F};               ///< unit length: across the chord; y is down
    float bend = 0.0F;                     ///< by how much the edge's middle lies to the left of the straight line
    float fraction = 0.0F;                 ///< of the left side
    glm::vec2 centroid{0.0F};              ///< of the left side
    std::array<std::uint32_t, 2> edges{};  ///< where it starts and ends
    /// The known features of each side; the first is that to the left.
    std::array<std::array<KnownFeature, 8>, 2> known{};
    std::array<std::uint8_t, 2> counts{};

    [[nodiscard]] glm::vec2 end(std::size_t i) const { return i == 0 ? start : start + chord; }
    [[nodiscard]] glm::vec2 middle_of_edge() const { return start + 0.5F * chord + bend * to_left; }
    /// Whether a place of the pixel, from its centre, lies on the left side, but for the bend.
    [[nodiscard]] bool is_left(const glm::vec2& position) const { return glm::dot(position - start, to_left) > 0.0F; }
  };

  /// `job`: any sample of the tile.
  void find(const LightContext& context, RayBuffers& buffers, const TileJob& job);

  [[nodiscard]] const std::vector<Pixel>& crossed() const { return crossed_; }
  [[nodiscard]] std::span<const SurfaceFeature> features() const { return features_; }

 private:
  /// Between two corners, in direction of x or of y.
  struct Edge {
    glm::dvec2 start{0.0};
    glm::dvec2 direction{0.0};
    /// The silhouette lies between these fractions of the edge, where features `before` and `after` were seen.
    double low = 0.0;
    double high = 1.0;
    std::uint32_t before = 0;
    std::uint32_t after = 0;
    bool is_clear = true;  ///< what was seen between was always like one of them, and only one
    std::array<std::int32_t, 2> pixels{
        -1, -1};  ///< indices into crossed(): pixels with sides that have this edge; -1: none

    [[nodiscard]] glm::dvec2 at(double part) const { return start + part * direction; }
    [[nodiscard]] glm::dvec2 center() const { return at(0.5 * (low + high)); }
  };

  /// From -1, which lies outside, to one past the last of the tile.
  [[nodiscard]] std::uint32_t corner(int x, int y) const {
    return static_cast<std::uint32_t>((y + 1) * (width_ + 3) + x + 1);
  }
  void trace_corners(const LightContext& context, RayBuffers& buffers, const TileJob& job);
  void find_edges();
  void find_edge(int x, int y, int axis);
  void bisect_edges(const LightContext& context, RayBuffers& buffers, const TileJob& job);
  void find_pixels();
  [[nodiscard]] bool differ(int x, int y, const glm::ivec2& direction) const;
  [[nodiscard]] bool is_thin(int x, int y) const;
  [[nodiscard]] bool is_thin_along(int x, int y, const glm::ivec2& axis) const;
  void find_sides(Pixel& pixel, int x, int y, const std::array<std::int32_t, 4>& around) const;
  [[nodiscard]] std::optional<glm::vec2> end_of_next(const Pixel& pixel, std::size_t end) const;
  [[nodiscard]] std::optional<float> even_bend(const Pixel& pixel) const;
  void bisect_bends(const LightContext& context, RayBuffers& buffers, const TileJob& job);
  void halve_bend(std::size_t i);
  [[nodiscard]] bool is_on_side(const Pixel& pixel, std::size_t side, const SurfaceFeature& feature) const;

  View view_;
  int width_ = 0;
  int height_ = 0;
  std::vector<SurfaceFeature> features_;  ///< first of the corners
  std::vector<Edge> edges_;
  std::array<std::vector<std::int32_t>, 2> edge_at_;  ///< [axis][corner]: the edge from there; -1: not crossed
  std::vector<Pixel> crossed_;
  // Of bisections.
  std::vector<SurfaceFeature> traced_features_;
  std::vector<Pixel*> bent_;
  std::vector<std::array<float, 2>> between_;
};

}  // namespace hpr
