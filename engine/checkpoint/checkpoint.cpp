#include "engine/checkpoint/checkpoint.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "core/bytes.h"
#include "core/error.h"
#include "core/text.h"
#include "engine/film.h"
#include "engine/plan.h"
#include "engine/samples.h"
#include "engine/session.h"
#include "engine/settings_table.h"
#include "rt/passes/pass_list.h"
#include "scene/view.h"

namespace hpr {
namespace {

constexpr std::array<char, 8> kMagic{'H', 'P', 'R', 'C', 'K', 'P', 'T', '\n'};
constexpr std::uint32_t kFormat = 3;

class Writer {
 public:
  template <typename Value>
  void put(const Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    put_bytes(std::as_bytes(std::span(&value, 1)));
  }
  void put(const std::string& text) {
    put(std::uint64_t{text.size()});
    put_bytes(std::as_bytes(std::span(text)));
  }
  void put_bytes(std::span<const std::byte> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }

  [[nodiscard]] std::vector<std::byte> take() { return std::move(bytes_); }
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

/// Reads what a Writer wrote. The checksum was right, so what does not fit is another program's doing.
class Reader {
 public:
  Reader(std::span<const std::byte> bytes, const std::string& name) : rest_(bytes), name_(name) {}

  template <typename Value>
  [[nodiscard]] Value get() {
    static_assert(std::is_trivially_copyable_v<Value>);
    Value value{};
    take(std::as_writable_bytes(std::span(&value, 1)));
    return value;
  }
  [[nodiscard]] std::string text() {
    const auto size = get<std::uint64_t>();
    if (size > rest_.size()) fail();
    std::string text(size, '\0');
    take(std::as_writable_bytes(std::span(text)));
    return text;
  }
  void take(std::span<std::byte> to) {
    if (to.size() > rest_.size()) fail();
    if (!to.empty()) std::memcpy(to.data(), rest_.data(), to.size());
    rest_ = rest_.subspan(to.size());
  }
  [[nodiscard]] std::size_t left() const { return rest_.size(); }

  [[noreturn]] void fail() const {
    throw Error(ExitCode::BadInput, fmt::format("{}: the checkpoint is damaged", name_),
                "start anew, without --resume");
  }

 private:
  std::span<const std::byte> rest_;
  const std::string& name_;
};

template <typename Pixel>
void put_layer(Writer& out, const TileLayer<Pixel>& layer) {
  out.put(std::uint64_t{sizeof(Pixel)});
  out.put(std::uint64_t{layer.active_tiles()});
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    if (!layer.active(tile)) continue;
    out.put(std::uint64_t{tile});
    out.put_bytes(std::as_bytes(layer.tile(tile)));
  }
}

template <typename Pixel>
bool is_possible(const Pixel& /*first*/) {
  return true;  // of the first sample, where a depth may be infinite
}
bool is_possible(double sum) {
  return std::isfinite(sum);
}
bool is_possible(const ColorSum& sum) {
  return std::isfinite(sum.r) && std::isfinite(sum.g) && std::isfinite(sum.b);
}
bool is_possible(const PixelSamples& pixel) {
  return pixel.wanted <= AdaptiveSampling::kMaxSamples && std::isfinite(pixel.squares) &&
         std::ranges::all_of(pixel.weights, [](double weight) { return std::isfinite(weight); });
}

/// Whether a run can have come to that, in a film of this kind.
bool is_possible(const Film& film, const Film::Counters& counters, const SampleProgress& progress) {
  const bool agree = film.is_adaptive() ? progress.budget >= film.pilot() : progress.samples == counters.samples;
  return agree && std::isfinite(counters.weights[0]) && std::isfinite(counters.weights[1]) &&
         std::isfinite(progress.seconds) && progress.seconds >= 0.0;
}

template <typename Pixel>
void get_layer(Reader& in, TileLayer<Pixel>& layer) {
  if (in.get<std::uint64_t>() != sizeof(Pixel)) in.fail();
  const auto count = in.get<std::uint64_t>();
  if (count > layer.tiles()) in.fail();
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto tile = in.get<std::uint64_t>();
    if (tile >= layer.tiles() || layer.active(tile)) in.fail();
    in.take(std::as_writable_bytes(layer.tile(tile)));
    if (!std::ranges::all_of(layer.tile(tile), [](const Pixel& pixel) { return is_possible(pixel); })) in.fail();
    layer.set_active(tile);
  }
}

RunIdentity get_identity(Reader& in) {
  RunIdentity found(std::min<std::uint64_t>(in.get<std::uint64_t>(), 1024));
  for (auto& [field, value] : found) {
    field = in.text();
    value = in.text();
  }
  return found;
}

void compare_identities(const RunIdentity& found, const RunIdentity& expected, const std::string& name) {
  for (std::size_t i = 0; i < std::max(found.size(), expected.size()); ++i) {
    if (i < found.size() && i < expected.size() && found[i] == expected[i]) continue;
    const auto& field = i < expected.size() ? expected[i].first : found[i].first;
    const auto& theirs = i < found.size() ? found[i].second : std::string("none");
    const auto& ours = i < expected.size() ? expected[i].second : std::string("none");
    throw Error(ExitCode::BadInput,
                fmt::format("{}: the checkpoint is of another run: its {} is {}, not {}", name, printable(field),
                            printable(theirs, 200), printable(ours, 200)),
                "give the options it was made with, or start anew without --resume");
  }
}

/// The part the checksum covers.
std::span<const std::byte> checked_part(std::span<const std::byte> bytes, const std::string& name) {
  constexpr std::size_t kHead = kMagic.size() + sizeof kFormat;
  if (bytes.size() < kMagic.size() || std::memcmp(bytes.data(), kMagic.data(), kMagic.size()) != 0) {
    throw DamagedCheckpoint(ExitCode::BadInput, fmt::format("{}: not a checkpoint", name), "name one that hpr wrote");
  }
  std::uint32_t format = 0;
  if (bytes.size() >= kHead) std::memcpy(&format, bytes.data() + kMagic.size(), sizeof format);
  std::uint64_t hash = 0;
  if (format == kFormat && bytes.size() >= kHead + sizeof hash) {
    std::memcpy(&hash, bytes.data() + bytes.size() - sizeof hash, sizeof hash);
    const auto covered = bytes.first(bytes.size() - sizeof hash);
    if (xxh64(covered) == hash) return covered.subspan(kHead);
  } else if (bytes.size() >= kHead && format != kFormat) {
    throw Error(ExitCode::BadInput,
                fmt::format("{}: a checkpoint of format {}; this hpr reads {}", name, format, kFormat),
                "go on with the hpr that wrote it, or start anew without --resume");
  }
  throw DamagedCheckpoint(ExitCode::BadInput, fmt::format("{}: the checkpoint is damaged", name),
                          "start anew, without --resume");
}

/// What stands before the identity.
bool get_asked_for(Reader& in) {
  return in.get<std::uint32_t>() != 0;
}

}  // namespace

std::vector<std::byte> encode_checkpoint(const RunIdentity& identity, Film& film, const SampleProgress& progress,
                                         bool asked_for) {
  Writer out;
  out.put(kMagic);
  out.put(kFormat);
  out.put(std::uint32_t{asked_for ? 1U : 0U});
  out.put(std::uint64_t{identity.size()});
  for (const auto& [field, value] : identity) {
    out.put(field);
    out.put(value);
  }
  const Film::Counters counters = film.counters();
  out.put(counters.samples);
  out.put(counters.weights);
  out.put(progress.samples);
  out.put(progress.budget);
  out.put(progress.seconds);
  out.put(progress.relmse.value_or(-1.0));
  film.each_layer([&](const auto& layer) { put_layer(out, layer); });
  out.put(xxh64(out.bytes()));
  return out.take();
}

void check_whole(std::span<const std::byte> bytes, const std::string& name) {
  (void)checked_part(bytes, name);
}

bool was_asked_for(std::span<const std::byte> bytes, const std::string& name) {
  Reader in(checked_part(bytes, name), name);
  return get_asked_for(in);
}

RunIdentity identity_in(std::span<const std::byte> bytes, const std::string& name) {
  Reader in(checked_part(bytes, name), name);
  (void)get_asked_for(in);
  return get_identity(in);
}

SampleProgress decode_checkpoint(std::span<const std::byte> bytes, const std::string& name, const RunIdentity& identity,
                                 Film& film) {
  Reader in(checked_part(bytes, name), name);
  (void)get_asked_for(in);
  compare_identities(get_identity(in), identity, name);
  Film::Counters counters;
  counters.samples = in.get<std::uint32_t>();
  counters.weights = in.get<std::array<double, 2>>();
  SampleProgress progress;
  progress.samples = in.get<std::uint32_t>();
  progress.budget = in.get<std::uint32_t>();
  progress.seconds = in.get<double>();
  if (const auto relmse = in.get<double>(); relmse >= 0.0) progress.relmse = relmse;
  if (!is_possible(film, counters, progress)) in.fail();
  film.each_layer([&](auto& layer) { get_layer(in, layer); });
  if (in.left() != 0) in.fail();
  film.set_counters(counters);
  return progress;
}

namespace {

constexpr const char* kKeys = "way to keys";
constexpr const char* kByRays = "by rays";
constexpr const char* kByRaster = "by raster";
constexpr const char* kDevice = "device";
constexpr const char* kNoDevice = "none";

/// Every bit of a view but its jitter, which belongs to the sample.
std::string describe(const View& view) {
  std::array<double, 17> numbers{view.eye.x, view.eye.y, view.eye.z};
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row)
      numbers.at(3 + 3 * static_cast<std::size_t>(column) + static_cast<std::size_t>(row)) = view.axes[column][row];
  }
  numbers[12] = view.left;
  numbers[13] = view.right;
  numbers[14] = view.bottom;
  numbers[15] = view.top;
  numbers[16] = view.near_distance;
  return fmt::format("{}x{}+{}+{} of {}x{} number {} {} far {} {}", view.block.width(), view.block.height(),
                     view.block.x0, view.block.y0, view.screen.width, view.screen.height, view.screen_number,
                     view.orthographic ? "orthographic" : "perspective", view.far_distance,
                     hex16(xxh64(std::as_bytes(std::span(numbers)))));
}

}  // namespace

RunIdentity identity_of(const Session& session, const FramePlan& plan, std::span<const View> views,
                        const RenderSettings& settings, bool keeps_keys) {
  RunIdentity identity{
      {"program", fmt::format("hpr {} ({})", kVersion, kCommit)},
      {"scene", hex16(content_hash(session.scene()))},
      {"seed", fmt::format("{}", plan.rays.seed)},
  };
  for (std::size_t i = 0; i < views.size(); ++i) {
    identity.emplace_back(fmt::format("view {}", i), describe(views[i]));
  }
  std::vector<std::string_view> passes;
  for (const PassPlan& pass : plan_passes(session.requirements(), plan.rays)) {
    if (pass.runs) passes.push_back(name_of(pass.pass));
  }
  identity.emplace_back("list of passes", fmt::format("'{}'", fmt::join(passes, ",")));
  identity.emplace_back("number of photons", fmt::format("{}", plan.rays.photons));
  identity.emplace_back(kKeys, plan.primary == Primary::Rays ? kByRays : kByRaster);
  const bool uses_device = plan.keys_on_device || plan.rays.on_device;
  identity.emplace_back(kDevice, uses_device ? session.device_and_driver() : kNoDevice);
  for (const Setting& setting : all_settings()) {
    if (setting.decides_bits) {
      identity.emplace_back(fmt::format("--{}", setting.name), fmt::format("'{}'", setting.value.write(settings)));
    }
  }
  const SampleGoal& goal = settings.sampling.goal;
  const std::string samples = goal.samples ? fmt::format("{}", *goal.samples) : "open";
  identity.emplace_back("number of adaptive samples", settings.sampling.adaptive ? samples : "none");
  identity.emplace_back("--raw", keeps_keys ? "given" : "left out");
  return identity;
}

Primary primary_of(const RunIdentity& identity) {
  for (const auto& [field, value] : identity) {
    if (field != kKeys) continue;
    if (value == kByRays) return Primary::Rays;
    if (value == kByRaster) return Primary::Raster;
  }
  return Primary::Auto;
}

bool had_device(const RunIdentity& identity) {
  const auto device =
      std::ranges::find(identity, kDevice, [](const RunIdentity::value_type& field) { return field.first; });
  return device != identity.end() && device->second != kNoDevice;
}

}  // namespace hpr
