#include "tools/bench/bench_codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <functional>

#include "tools/bench/bench_codec_peers.h"
#include "tools/bench/bench_times.h"
#include "walls/codecs/codec.h"

namespace hpr {
namespace {

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

/// Medians of CPU time in ms, both in turn, after one each that is not counted.
Pair times_of(const std::function<void()>& ours, const std::function<void()>& peers) {
  std::vector<double> mine;
  std::vector<double> theirs;
  for (int i = -1; i < kRepetitions; ++i) {
    const double start = thread_ms();
    ours();
    const double middle = thread_ms();
    peers();
    if (i < 0) continue;
    mine.push_back(middle - start);
    theirs.push_back(thread_ms() - middle);
  }
  return {median(mine), median(theirs)};
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

}  // namespace

std::vector<BenchRow> bench_codec(const CodecFrames& frames) {
  std::vector<BenchRow> rows;
  for (const Case& one : kCases) add_case(frames.scene, frames.turning.front(), one, rows);
  add_sequence(frames.scene + " turning", frames.turning, rows);
  add_sequence(frames.scene + " standing", frames.standing, rows);
  return rows;
}

}  // namespace hpr
