#include <fmt/format.h>
#include <lz4.h>
#include <turbojpeg.h>
#include <zstd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "app/options/globals.h"
#include "app/options/render_options.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "core/progress.h"
#include "core/text.h"
#include "engine/frame_maker.h"
#include "engine/output.h"
#include "engine/session.h"
#include "image/color.h"
#include "image/image.h"
#include "image/image_io.h"
#include "tools/bench/bench.h"
#include "tools/sweep.h"
#include "walls/codecs/codec.h"

namespace hpr {
namespace {

/// A library's plainest calls on a picture's pixels, as whoever has no codec of ours would write them.
class CodecPeer {
 public:
  virtual ~CodecPeer() = default;

  /// Returns the bytes it takes; kept for decode().
  virtual std::size_t encode(const Image<Rgba8>& picture) = 0;
  virtual void decode(Image<Rgba8>& picture) = 0;
};

class Copy final : public CodecPeer {
 public:
  std::size_t encode(const Image<Rgba8>& picture) override {
    bytes_.resize(picture.pixels().size_bytes());
    std::memcpy(bytes_.data(), picture.pixels().data(), bytes_.size());
    return bytes_.size();
  }
  void decode(Image<Rgba8>& picture) override { std::memcpy(picture.pixels().data(), bytes_.data(), bytes_.size()); }

 private:
  std::vector<char> bytes_;
};

class BareLz4 final : public CodecPeer {
 public:
  std::size_t encode(const Image<Rgba8>& picture) override {
    const auto size = static_cast<int>(picture.pixels().size_bytes());
    bytes_.resize(static_cast<std::size_t>(LZ4_compressBound(size)));
    used_ = LZ4_compress_default(reinterpret_cast<const char*>(picture.pixels().data()), bytes_.data(), size,
                                 static_cast<int>(bytes_.size()));
    HPR_CHECK(used_ > 0);
    return static_cast<std::size_t>(used_);
  }
  void decode(Image<Rgba8>& picture) override {
    const auto size = static_cast<int>(picture.pixels().size_bytes());
    HPR_CHECK(LZ4_decompress_safe(bytes_.data(), reinterpret_cast<char*>(picture.pixels().data()), used_, size) ==
              size);
  }

 private:
  std::vector<char> bytes_;
  int used_ = 0;
};

/// At its fastest level that codes by frequency.
class BareZstd final : public CodecPeer {
 public:
  std::size_t encode(const Image<Rgba8>& picture) override {
    bytes_.resize(ZSTD_compressBound(picture.pixels().size_bytes()));
    used_ = ZSTD_compressCCtx(compressor_.get(), bytes_.data(), bytes_.size(), picture.pixels().data(),
                              picture.pixels().size_bytes(), 1);
    HPR_CHECK(ZSTD_isError(used_) == 0U);
    return used_;
  }
  void decode(Image<Rgba8>& picture) override {
    const std::size_t read = ZSTD_decompressDCtx(decompressor_.get(), picture.pixels().data(),
                                                 picture.pixels().size_bytes(), bytes_.data(), used_);
    HPR_CHECK(read == picture.pixels().size_bytes());
  }

 private:
  struct Free {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
    void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
  };
  std::unique_ptr<ZSTD_CCtx, Free> compressor_{ZSTD_createCCtx()};
  std::unique_ptr<ZSTD_DCtx, Free> decompressor_{ZSTD_createDCtx()};
  std::vector<char> bytes_;
  std::size_t used_ = 0;
};

/// With the options our codec has, so that the same picture comes out.
class BareJpeg final : public CodecPeer {
 public:
  explicit BareJpeg(int quality) : quality_(quality) {}

  std::size_t encode(const Image<Rgba8>& picture) override {
    used_ = tjBufSize(picture.width(), picture.height(), TJSAMP_444);
    bytes_.resize(used_);
    unsigned char* into = bytes_.data();
    HPR_CHECK(tjCompress2(compressor_.get(), reinterpret_cast<const unsigned char*>(picture.pixels().data()),
                          picture.width(), 0, picture.height(), TJPF_RGBX, &into, &used_, TJSAMP_444, quality_,
                          TJFLAG_NOREALLOC | TJFLAG_ACCURATEDCT) == 0);
    return used_;
  }
  void decode(Image<Rgba8>& picture) override {
    HPR_CHECK(tjDecompress2(decompressor_.get(), bytes_.data(), used_,
                            reinterpret_cast<unsigned char*>(picture.pixels().data()), picture.width(), 0,
                            picture.height(), TJPF_RGBA, TJFLAG_ACCURATEDCT) == 0);
  }

 private:
  struct Free {
    void operator()(void* handle) const { tjDestroy(handle); }
  };
  int quality_;
  std::unique_ptr<void, Free> compressor_{tjInitCompress()};
  std::unique_ptr<void, Free> decompressor_{tjInitDecompress()};
  std::vector<unsigned char> bytes_;
  unsigned long used_ = 0;
};

/// The peer of a codec: a copy for raw. `quality`: of jpeg.
std::unique_ptr<CodecPeer> make_codec_peer(std::string_view codec, int quality) {
  if (codec == "lz4") return std::make_unique<BareLz4>();
  if (codec == "zstd") return std::make_unique<BareZstd>();
  if (codec == "jpeg") return std::make_unique<BareJpeg>(quality);
  HPR_CHECK(codec == "raw");
  return std::make_unique<Copy>();
}

/// Frames of one scene to measure codecs on.
struct CodecFrames {
  std::string scene;
  std::vector<Image<Rgba8>> turning;   ///< the camera turns by a quarter of a degree from each to the next; not empty
  std::vector<Image<Rgba8>> standing;  ///< the same view again and again, each with its own noise
};

constexpr double kTurn = 0.25 * std::numbers::pi / 180.0;

Camera turned(Camera camera, int steps) {
  camera.axes = glm::dmat3(glm::rotate(glm::dmat4(1.0), steps * kTurn, camera.axes[1])) * camera.axes;
  return camera;
}

/// Draws what codecs are measured on: `count` frames of a turning camera and as many of a standing one, with the
/// settings `hpr render` has by default. By this process alone.
CodecFrames draw_codec_frames(const std::string& scene, Size size, int count, const Globals& globals) {
  CodecFrames frames;
  frames.scene = scene;
  const RenderSettings settings = resolve({}, globals.seed);
  run_local_ranks(1, [&](Communicator& comm) {
    Session session(comm, globals.session(), [&] { return load_scene(scene, settings, globals, size); });
    const Camera camera = choose_camera(settings.camera, session.scene());
    const auto view_after = [&](int steps) { return make_view(turned(camera, steps), size, session.scene().bounds); };
    const View first = view_after(0);
    FrameMaker maker(session, settings.frame, settings.sampling, std::span(&first, 1), std::nullopt);
    prepare(session, maker.plan());
    Progress progress(globals.progress, scene + ": frame", static_cast<std::size_t>(2 * count));
    Progress silent("none", "sample", 0);
    const auto draw = [&](const View& view, std::uint64_t number) {
      Frame& frame = *maker.make(std::span(&view, 1), number, silent);
      std::vector<Image<Rgba8>> pictures =
          bring_to_screens(session, frame, maker.blocks(), {{size}, {0}, fixed_transform(settings.display)});
      progress.step("");
      return std::move(pictures.front());
    };
    for (int i = 0; i < count; ++i) frames.turning.push_back(draw(view_after(i), static_cast<std::uint64_t>(i)));
    for (int i = 0; i < count; ++i) frames.standing.push_back(draw(first, static_cast<std::uint64_t>(i)));
  });
  return frames;
}

constexpr int kRepetitions = 9;

struct Case {
  const char* codec;
  int error;
};
constexpr Case kCases[] = {{"raw", 0}, {"lz4", 0}, {"zstd", 0}, {"jpeg", 0}, {"lz4", 2}, {"zstd", 2}, {"jpeg", 2}};

std::string title_of(const Case& one) {
  return one.error == 0 ? one.codec : fmt::format("{} within {}", one.codec, one.error);
}

struct Pair {
  double ours = 0.0;
  double peers = 0.0;
};

/// Medians of CPU time in ms, both in turns.
Pair times_of(const std::function<void()>& ours, const std::function<void()>& peers) {
  const std::vector<double> medians = median_times({ours, peers}, {1, kRepetitions}, thread_ms);
  return {medians[0], medians[1]};
}

double megabytes_per_second(const Image<Rgba8>& picture, double ms) {
  return static_cast<double>(picture.pixels().size_bytes()) / 1e3 / ms;
}

double times_smaller(const Image<Rgba8>& picture, std::size_t bytes) {
  return static_cast<double>(picture.pixels().size_bytes()) / static_cast<double>(bytes);
}

int largest_error(const Image<Rgba8>& a, const Image<Rgba8>& b) {
  int largest = 0;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) {
    const Rgba8 x = a.pixels()[i];
    const Rgba8 y = b.pixels()[i];
    largest = std::max({largest, std::abs(x.r - y.r), std::abs(x.g - y.g), std::abs(x.b - y.b), std::abs(x.a - y.a)});
  }
  return largest;
}

void add_case(const std::string& scene, const Image<Rgba8>& picture, const Case& one, std::vector<BenchRow>& rows) {
  const CodecSettings settings{.error = one.error};
  const auto sender = make_codec(one.codec, settings);
  const auto receiver = make_codec(one.codec, settings);
  const auto peer = make_codec_peer(one.codec, settings.quality);
  std::vector<std::byte> bytes;
  std::size_t peer_bytes = 0;
  const Pair encode = times_of([&] { bytes = sender->encode(picture); }, [&] { peer_bytes = peer->encode(picture); });
  Image<Rgba8> ours(picture.size());
  Image<Rgba8> theirs(picture.size());
  const Pair decode = times_of([&] { receiver->decode(bytes, ours); }, [&] { peer->decode(theirs); });
  const std::string name = scene + ", " + title_of(one);
  const auto add = [&](const char* what, Pair values, const char* unit, double ratio) {
    rows.push_back({fmt::format("{}: {}", name, what), values.ours, values.peers, unit, ratio});
  };
  add("encode", {megabytes_per_second(picture, encode.ours), megabytes_per_second(picture, encode.peers)}, "MB/s",
      encode.peers / encode.ours);
  add("decode", {megabytes_per_second(picture, decode.ours), megabytes_per_second(picture, decode.peers)}, "MB/s",
      decode.peers / decode.ours);
  const Pair smaller{times_smaller(picture, bytes.size()), times_smaller(picture, peer_bytes)};
  add("smaller by", smaller, "x", smaller.ours / smaller.peers);
  const double error = largest_error(picture, ours);
  const bool unbounded = one.error == 0 && one.codec == std::string_view("jpeg");
  const double allowed = unbounded ? largest_error(picture, theirs) : one.error;
  add("largest error", {error, allowed}, "of 255", error > 0.0 ? allowed / error : 1.0);
}

/// How much smaller all but the first picture of a sequence get.
double sequence_smaller(const std::vector<Image<Rgba8>>& pictures, const Case& one, bool deltas) {
  const auto sender = make_codec(one.codec, {.error = one.error, .deltas = deltas});
  std::size_t pixel_bytes = 0;
  std::size_t sent = 0;
  for (const Image<Rgba8>& picture : pictures) {
    const std::size_t bytes = sender->encode(picture).size();
    if (&picture == &pictures.front()) continue;
    pixel_bytes += picture.pixels().size_bytes();
    sent += bytes;
  }
  return static_cast<double>(pixel_bytes) / static_cast<double>(sent);
}

void add_sequence(const std::string& name, const std::vector<Image<Rgba8>>& pictures, std::vector<BenchRow>& rows) {
  if (pictures.size() < 2) return;
  for (const Case& one : {Case{"zstd", 0}, Case{"zstd", 2}, Case{"jpeg", 0}}) {
    const Pair smaller{sequence_smaller(pictures, one, true), sequence_smaller(pictures, one, false)};
    rows.push_back({fmt::format("{}, {}: deltas, smaller by", name, title_of(one)), smaller.ours, smaller.peers, "x",
                    smaller.ours / smaller.peers});
  }
}

/// Every codec on one core: how it encodes and decodes the first frame, and how much smaller the frame gets, against
/// the bare library's call on the same pixels (raw: a copy), both in turn, medians of CPU time; the largest error seen
/// against its bound, for jpeg without one against the bare library's; and what deltas save over sequences. A second or
/// two.
std::vector<BenchRow> bench_codec(const CodecFrames& frames) {
  std::vector<BenchRow> rows;
  for (const Case& one : kCases) add_case(frames.scene, frames.turning.front(), one, rows);
  add_sequence(frames.scene + " turning", frames.turning, rows);
  add_sequence(frames.scene + " standing", frames.standing, rows);
  return rows;
}

class BenchCodecCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "codec"; }
  [[nodiscard]] std::string_view summary() const override {
    return "picture codecs of one core on rendered frames, against the bare libraries";
  }

  void declare(const OptionSet& options) override {
    options.option("scene", scenes_, "other scenes to draw (default: gen:gallery gen:cornell)");
    options.option("--size", size_, "pixels of the frames").show_default().type("WxH");
    options.option("--frames", frames_, "of each sequence that deltas are measured on").range(1, 1000).show_default();
    options.flag("--json", json_, "one JSON document");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const auto extent = parse_extent(size_);
    if (!extent) {
      throw Error(ExitCode::Usage, fmt::format("--size: '{}' is no size", size_), "write e.g. 1280x720");
    }
    const Size size{extent->first, extent->second};
    check_size(size, globals.picture_limits());
    std::vector<BenchRow> rows;
    for (const std::string& scene : scenes_) {
      const std::vector<BenchRow> more = bench_codec(draw_codec_frames(scene, size, frames_, globals));
      rows.insert(rows.end(), more.begin(), more.end());
    }
    print_bench(rows, this_machine().cpu, json_);
    return ExitCode::Done;
  }

 private:
  std::vector<std::string> scenes_{"gen:gallery", "gen:cornell"};
  std::string size_ = "1280x720";
  int frames_ = 4;
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> make_bench_codec_command() {
  return std::make_unique<BenchCodecCommand>();
}

}  // namespace hpr
