#include "raster/keys/key_readback.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <utility>

namespace hpr {
namespace {

/// A workgroup a tile. Low words come first, as in a little-endian 64-bit key.
constexpr std::string_view kPackShader = R"(#version 450 core
layout(local_size_x = 64, local_size_y = 4) in;
layout(binding = 0) uniform sampler2D depths;
layout(binding = 1) uniform usampler2D words;
layout(std430, binding = 0) writeonly restrict buffer Keys { uvec2 keys[]; };
layout(std430, binding = 1) writeonly restrict buffer Drawn { uint drawn[]; };
layout(location = 0) uniform ivec4 pixels;       // of the view, from its upper left corner: x0, y0, x1, y1
layout(location = 1) uniform ivec4 grid;         // first column and row of the tiles, columns, rows before these
layout(location = 2) uniform int view_height;
shared uint any_bits;

void main() {
  if (gl_LocalInvocationIndex == 0u) any_bits = 0u;
  barrier();
  const uint tile = gl_WorkGroupID.y * uint(grid.z) + gl_WorkGroupID.x;
  const ivec2 corner = (grid.xy + ivec2(0, grid.w) + ivec2(gl_WorkGroupID.xy)) * 64;
  uint bits = 0u;
  for (uint row = gl_LocalInvocationID.y; row < 64u; row += gl_WorkGroupSize.y) {
    const ivec2 pixel = corner + ivec2(gl_LocalInvocationID.x, row);
    uvec2 key = uvec2(0u);
    if (all(greaterThanEqual(pixel, pixels.xy)) && all(lessThan(pixel, pixels.zw))) {
      const ivec2 texel = ivec2(pixel.x, view_height - 1 - pixel.y);
      key = uvec2(texelFetch(words, texel, 0).r, floatBitsToUint(texelFetch(depths, texel, 0).r));
    }
    bits |= key.y;
    keys[tile * 4096u + row * 64u + gl_LocalInvocationID.x] = key;
  }
  if (bits != 0u) atomicOr(any_bits, 1u);
  barrier();
  if (gl_LocalInvocationIndex == 0u) drawn[uint(grid.w) * uint(grid.z) + tile] = any_bits;
}
)";

constexpr std::size_t kTileBytes = kTilePixels * sizeof(Key);
/// As many bytes as every GL lets a shader store to (GL_MAX_SHADER_STORAGE_BLOCK_SIZE, OpenGL 4.5, table 23.64).
constexpr std::size_t kTilesAtOnce = (std::size_t{1} << 24U) / kTileBytes;

/// In steps, so that a moving view does not make a new buffer every frame.
std::size_t with_room(std::size_t bytes) {
  constexpr std::size_t kStep = std::size_t{1} << 20U;
  return (bytes + kStep - 1) / kStep * kStep;
}

/// Memory that GL writes to, and that stays mapped for reading.
class MappedBuffer {
 public:
  void reserve(GlContext& context, std::size_t bytes) {
    if (bytes <= size_) return;
    size_ = 0;
    buffer_ = GlObject();
    buffer_ = make_buffer(context);
    constexpr GLbitfield kAccess = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    const GlFunctions& gl = context.gl();
    const auto size = static_cast<GLsizeiptr>(with_room(bytes));
    gl.NamedBufferStorage(buffer_.name(), size, nullptr, kAccess | GL_CLIENT_STORAGE_BIT);
    memory_ = static_cast<const std::byte*>(gl.MapNamedBufferRange(buffer_.name(), 0, size, kAccess));
    check_gl(gl, "mapping memory for keys");
    size_ = static_cast<std::size_t>(size);
  }
  [[nodiscard]] GLuint name() const { return buffer_.name(); }
  [[nodiscard]] const std::byte* memory() const { return memory_; }

 private:
  GlObject buffer_;
  const std::byte* memory_ = nullptr;
  std::size_t size_ = 0;
};

class PixelReadback final : public KeyReadback {
 public:
  explicit PixelReadback(GlContext& context) : context_(context) {}

  void start(const KeyTarget& /*target*/, Size view, const Rect& pixels) override {
    pixels_ = pixels.area();
    mapped_.reserve(context_, pixels_ * (sizeof(float) + sizeof(std::uint32_t)));
    const GlFunctions& gl = context_.gl();
    gl.BindBuffer(GL_PIXEL_PACK_BUFFER, mapped_.name());
    gl.PixelStorei(GL_PACK_ALIGNMENT, 4);
    gl.PixelStorei(GL_PACK_ROW_LENGTH, 0);
    const int y = view.height - pixels.y1;
    // In the formats they are stored in: any conversion costs 4 to 20 times as much.
    gl.ReadPixels(pixels.x0, y, pixels.width(), pixels.height(), GL_DEPTH_COMPONENT, GL_FLOAT, nullptr);
    // NOLINTNEXTLINE(performance-no-int-to-ptr): GL takes offsets as pointers
    auto* const after_depths = reinterpret_cast<void*>(pixels_ * sizeof(float));
    gl.ReadPixels(pixels.x0, y, pixels.width(), pixels.height(), GL_RED_INTEGER, GL_UNSIGNED_INT, after_depths);
    gl.BindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    done_.emplace(context_);
  }

  [[nodiscard]] DrawnKeys finish() override {
    done_->wait("reading keys");
    done_.reset();
    const std::byte* const memory = mapped_.memory();
    return KeyHalves{{reinterpret_cast<const float*>(memory), pixels_},
                     {reinterpret_cast<const std::uint32_t*>(memory + pixels_ * sizeof(float)), pixels_}};
  }

 private:
  GlContext& context_;
  MappedBuffer mapped_;
  std::size_t pixels_ = 0;
  std::optional<GlFence> done_;
};

class ShaderReadback final : public KeyReadback {
 public:
  explicit ShaderReadback(GlContext& context)
      : context_(context), program_(make_compute_program(context, kPackShader)) {}

  void start(const KeyTarget& target, Size view, const Rect& pixels) override {
    const TileGrid grid = tiles_around(pixels);
    tiles_ = grid.tiles();
    const std::size_t bytes = tiles_ * (kTileBytes + sizeof(std::uint32_t));
    reserve(bytes);
    const GlFunctions& gl = context_.gl();
    gl.UseProgram(program_.name());
    gl.BindTextureUnit(0, target.depths());
    gl.BindTextureUnit(1, target.words());
    gl.Uniform4i(0, pixels.x0, pixels.y0, pixels.x1, pixels.y1);
    gl.Uniform1i(2, view.height);
    gl.BindBufferRange(GL_SHADER_STORAGE_BUFFER, 1, packed_.name(), static_cast<GLintptr>(tiles_ * kTileBytes),
                       static_cast<GLsizeiptr>(tiles_ * sizeof(std::uint32_t)));
    pack_rows(grid);
    gl.MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    gl.CopyNamedBufferSubData(packed_.name(), mapped_.name(), 0, 0, static_cast<GLsizeiptr>(bytes));
    done_.emplace(context_);
  }

  [[nodiscard]] DrawnKeys finish() override {
    done_->wait("reading keys");
    done_.reset();
    const std::byte* const memory = mapped_.memory();
    return KeyTiles{{reinterpret_cast<const Key*>(memory), tiles_ * kTilePixels},
                    {reinterpret_cast<const std::uint32_t*>(memory + tiles_ * kTileBytes), tiles_}};
  }

 private:
  void reserve(std::size_t bytes) {
    mapped_.reserve(context_, bytes);
    if (bytes <= packed_bytes_) return;
    packed_bytes_ = 0;
    packed_ = GlObject();
    packed_ = make_buffer(context_);
    context_.gl().NamedBufferStorage(packed_.name(), static_cast<GLsizeiptr>(with_room(bytes)), nullptr, 0);
    check_gl(context_.gl(), "making a buffer for keys");
    packed_bytes_ = with_room(bytes);
  }

  /// As many rows of tiles at once as a shader reaches.
  void pack_rows(const TileGrid& grid) {
    const GlFunctions& gl = context_.gl();
    const std::size_t row_bytes = static_cast<std::size_t>(grid.columns) * kTileBytes;
    const int step = std::max(static_cast<int>(kTilesAtOnce / static_cast<std::size_t>(grid.columns)), 1);
    for (int row = 0; row < grid.rows; row += step) {
      const int rows = std::min(step, grid.rows - row);
      gl.BindBufferRange(GL_SHADER_STORAGE_BUFFER, 0, packed_.name(),
                         static_cast<GLintptr>(static_cast<std::size_t>(row) * row_bytes),
                         static_cast<GLsizeiptr>(static_cast<std::size_t>(rows) * row_bytes));
      gl.Uniform4i(1, grid.first_column, grid.first_row, grid.columns, row);
      gl.DispatchCompute(static_cast<GLuint>(grid.columns), static_cast<GLuint>(rows), 1);
    }
  }

  GlContext& context_;
  GlObject program_;
  GlObject packed_;
  MappedBuffer mapped_;
  std::size_t packed_bytes_ = 0;
  std::size_t tiles_ = 0;
  std::optional<GlFence> done_;
};

}  // namespace

std::vector<KeyRoute> all_key_routes() {
  return {KeyRoute::Pixels, KeyRoute::Shader};
}

std::string_view route_name(KeyRoute route) {
  constexpr std::array<std::string_view, 2> kNames{"pixels", "shader"};
  return kNames.at(static_cast<std::size_t>(route));
}

KeyRoute fastest_route(const GlContext& context) {
  return context.software() ? KeyRoute::Pixels : KeyRoute::Shader;
}

std::unique_ptr<KeyReadback> make_key_readback(KeyRoute route, GlContext& context) {
  if (route == KeyRoute::Pixels) return std::make_unique<PixelReadback>(context);
  return std::make_unique<ShaderReadback>(context);
}

}  // namespace hpr
