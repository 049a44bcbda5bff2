#include "engine/balance/light_lending.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator.h"
#include "core/error.h"
#include "core/interrupt.h"
#include "core/job_board.h"
#include "core/log.h"
#include "core/timing.h"
#include "engine/balance/load_balance.h"

namespace hpr {
namespace {

/// Of shared memory for all ranks together, and the least for one. Where the tiles of a frame need more, the dearest
/// are offered.
constexpr std::size_t kBoardBytes = std::size_t{32} << 20U;
constexpr std::size_t kMinBoardBytes = std::size_t{1} << 20U;
/// So many parts a thread has to light are fine enough: ranks then end within a sixtieth of each other.
constexpr double kPartsPerThread = 64.0;
constexpr std::chrono::microseconds kNap{50};

/// A tile with about what it costs.
struct CostlyTile {
  std::size_t tile = 0;
  double cost = 0.0;
};

/// This rank's tiles, the dearest first.
std::vector<CostlyTile> dearest_first(const LightLending::Work& work) {
  const ShadedSample& sample = work.samples.front();
  std::vector<CostlyTile> tiles;
  for (const std::size_t tile : work.owned) {
    double cost = work.costs.empty() ? cost_of_keys(*sample.keys, tile) : work.costs[tile];
    if (const auto mask = mask_of(sample.wanted, tile); !mask.empty()) {
      cost *= static_cast<double>(std::ranges::count(mask, std::uint8_t{1})) / kTilePixels;
    }
    tiles.push_back({tile, cost});
  }
  std::ranges::stable_sort(tiles, std::ranges::greater(), &CostlyTile::cost);
  return tiles;
}

/// Into how many parts a tile is cut: a power of two, as its rows are.
int parts_of(double cost, double part_cost) {
  const double wanted = part_cost > 0.0 ? cost / part_cost : 1.0;
  return static_cast<int>(std::bit_ceil(static_cast<unsigned>(std::clamp(wanted, 1.0, double{kTileSide}))));
}

/// Calls `visit` with every layer that a sample is shaded into.
template <typename Visitor>
void each_layer(const LightOutput& output, const Visitor& visit) {
  const auto visit_if = [&](auto* layer) {
    if (layer != nullptr) visit(*layer);
  };
  visit_if(output.radiance);
  for (TileLayer<Rgb>* layer : output.components) visit_if(layer);
  visit_if(output.normal);
  visit_if(output.albedo);
  visit_if(output.cost);
  visit_if(output.coverage);
}

/// Calls `visit` with the bytes of those rows in every layer of every sample.
template <typename Visitor>
void each_span(std::span<const ShadedSample> samples, const LentRows& rows, const Visitor& visit) {
  for (const ShadedSample& sample : samples) {
    each_layer(sample.output, [&](auto& layer) {
      visit(std::as_writable_bytes(layer.tile(rows.tile).subspan(rows.first_pixel(), rows.pixels())));
    });
  }
}

}  // namespace

/// What the threads of a rank light next: what it offers to nobody, what it offers, what others offer.
class LightLending::Drawing {
 public:
  Drawing(const LightLending& lending, Communicator& comm, std::vector<ShadedPart> kept, const Work& work)
      : lending_(lending),
        board_(const_cast<WorkBoard&>(*lending.board_)),
        rank_(comm.rank()),
        ranks_(comm.size()),
        kept_(std::move(kept)),
        interrupt_(work.interrupt),
        patience_(work.patience) {}

  /// From any thread.
  std::optional<ShadedPart> next() {
    std::optional<Stopwatch> idle;
    while (true) {
      if (is_interrupted()) return std::nullopt;
      if (auto part = own()) return part;
      if (auto part = borrowed()) return part;
      if (!others_may_offer()) return std::nullopt;
      if (!idle) idle.emplace();
      if (std::chrono::duration<double, std::milli>(idle->ms()) > patience_) return std::nullopt;
      std::this_thread::sleep_for(kNap);
      report_step();
    }
  }

  /// After all threads are done.
  [[nodiscard]] const std::vector<LentRows>& lit_for_others() const { return lit_; }

 private:
  bool is_interrupted() {
    if (interrupt_ == nullptr) return false;
    if (interrupt_->is_raised()) board_.raise();
    return board_.is_raised();
  }

  std::optional<ShadedPart> own() {
    if (const std::size_t i = next_kept_.load() < kept_.size() ? next_kept_++ : kept_.size(); i < kept_.size())
      return kept_[i];
    const auto piece = board_.draw(rank_);
    if (!piece) return std::nullopt;
    const Offer offer = lending_.offer_of(rank_, *piece);
    return ShadedPart{.tile = offer.tile, .first_row = offer.first, .end_row = offer.end};
  }

  /// Of the rank that has most left.
  std::optional<ShadedPart> borrowed() {
    while (true) {
      int from = -1;
      std::uint64_t most = 0;
      for (int rank = 0; rank < ranks_; ++rank) {
        if (rank == rank_ || !board_.sees(rank)) continue;
        const std::uint64_t left = board_.remaining(rank);
        if (left > most) from = rank;
        most = std::max(most, left);
      }
      if (from < 0) return std::nullopt;
      const auto piece = board_.draw(from);
      if (!piece) continue;
      const Offer offer = lending_.offer_of(from, *piece);
      const std::byte* const slot =
          board_.payload_of(from).data() + lending_.max_offers() * sizeof(Offer) + offer.slot * lending_.slot_bytes();
      ShadedPart part{.tile = offer.tile,
                      .first_row = offer.first,
                      .end_row = offer.end,
                      .keys = reinterpret_cast<const Key*>(slot)};
      if (offer.has_mask != 0) {
        const std::byte* const mask = slot + lending_.round_.samples * kTilePixels * sizeof(Key);
        part.wanted = {reinterpret_cast<const std::uint8_t*>(mask), kTilePixels};
      }
      const std::lock_guard lock(mutex_);
      lit_.push_back({offer.tile, offer.first, offer.end, from, rank_});
      return part;
    }
  }

  [[nodiscard]] bool others_may_offer() const {
    for (int rank = 0; rank < ranks_; ++rank) {
      if (rank != rank_ && board_.sees(rank) && !board_.is_published(rank)) return true;
    }
    return false;
  }

  const LightLending& lending_;
  WorkBoard& board_;
  int rank_;
  int ranks_;
  std::vector<ShadedPart> kept_;
  std::atomic<std::size_t> next_kept_ = 0;
  Interrupt* interrupt_;
  std::chrono::milliseconds patience_;
  std::mutex mutex_;
  std::vector<LentRows> lit_;
};

std::size_t LightLending::slot_bytes() const {
  return (round_.samples * sizeof(Key) + 1) * kTilePixels;
}

std::size_t LightLending::slots() const {
  const auto ranks = static_cast<std::size_t>(ranks_);
  const std::size_t fit = std::max(kBoardBytes / ranks, kMinBoardBytes) / (slot_bytes() + kTileSide * sizeof(Offer));
  // A rank seldom has much more than an even part of the tiles.
  const std::size_t usual = round_.tiles / ranks + round_.tiles / (4 * ranks) + 4;
  return std::max<std::size_t>(std::min({round_.tiles, usual, fit}), 1);
}

std::size_t LightLending::max_offers() const {
  return slots() * kTileSide;
}

bool LightLending::start(Communicator& comm, const Round& round) {
  lent_.clear();
  if (is_impossible_) return false;
  round_ = round;
  ranks_ = comm.size();
  const std::size_t needed = max_offers() * sizeof(Offer) + slots() * slot_bytes();
  if (!board_ || board_->bytes() < needed) {
    try {
      board_.reset();
      board_.emplace(comm, needed);
    } catch (const Error& error) {
      if (error.code() != ExitCode::Limit) throw;
      is_impossible_ = true;  // on all ranks alike
      if (comm.rank() == 0) log::info("light is not lent between ranks: {}", error.what());
      return false;
    }
  }
  board_->next_round(comm);
  return true;
}

bool LightLending::sees_all(const Communicator& comm) const {
  for (int rank = 0; rank < comm.size(); ++rank) {
    if (!board_->sees(rank)) return false;
  }
  return true;
}

LightLending::Offer LightLending::offer_of(int rank, std::uint64_t piece) const {
  Offer offer;
  std::memcpy(&offer, board_->payload_of(rank).data() + piece * sizeof(Offer), sizeof(Offer));
  return offer;
}

void LightLending::write_slot(const Work& work, std::size_t slot, std::size_t tile) {
  std::byte* to = board_->payload().data() + max_offers() * sizeof(Offer) + slot * slot_bytes();
  for (const ShadedSample& sample : work.samples) {
    const std::span<const Key> keys = sample.keys->tile(tile);
    std::memcpy(to, keys.data(), keys.size_bytes());
    to += keys.size_bytes();
  }
  const auto mask = mask_of(work.samples.front().wanted, tile);
  if (!mask.empty()) std::memcpy(to, mask.data(), mask.size());
}

/// Offers this rank's tiles, as many as there is room for; returns the parts of those that there is none for.
std::vector<ShadedPart> LightLending::publish(const Work& work, bool whole_tiles) {
  const std::vector<CostlyTile> tiles = dearest_first(work);
  double sum = 0.0;
  for (const CostlyTile& each : tiles) sum += each.cost;
  const double part_cost = sum / (kPartsPerThread * std::max(work.threads, 1));
  std::vector<ShadedPart> kept;
  std::uint64_t offers = 0;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const std::size_t tile = tiles[i].tile;
    if (i >= slots() || tiles[i].cost == 0.0) {
      kept.push_back({.tile = tile});
      continue;
    }
    write_slot(work, i, tile);
    const int parts = whole_tiles ? 1 : parts_of(tiles[i].cost, part_cost);
    const int rows = kTileSide / parts;
    const int height = work.samples.front().keys->layout().place(tile).pixels.height();
    const bool has_mask = !mask_of(work.samples.front().wanted, tile).empty();
    for (int row = 0; row < height; row += rows) {
      // Past a screen's edge the last part has the rest of the tile.
      const int end = row + rows >= height ? kTileSide : row + rows;
      const Offer offer{static_cast<std::uint32_t>(tile), static_cast<std::uint16_t>(row),
                        static_cast<std::uint16_t>(end), static_cast<std::uint32_t>(i), has_mask ? 1U : 0U};
      std::memcpy(board_->payload().data() + offers++ * sizeof(Offer), &offer, sizeof(Offer));
    }
  }
  board_->publish(offers);
  return kept;
}

bool LightLending::shade(Communicator& comm, DeferredShader& shader, const Work& work) {
  for (const ShadedSample& sample : work.samples) {
    for (const std::size_t tile : work.owned) {
      each_layer(sample.output, [&](auto& layer) { layer.set_active(tile); });
    }
  }
  Drawing drawing(*this, comm, publish(work, shader.shades_whole_tiles()), work);
  shader.shade(work.samples, [&] { return drawing.next(); });

  const trace::Span span("return lent light");
  const Stopwatch watch;
  std::vector<LentRows> mine = drawing.lit_for_others();
  const bool interrupted = work.interrupt != nullptr && board_->is_raised();
  if (interrupted) mine.push_back({.owner = -1});
  std::vector<LentRows> all;
  for (const auto& list : all_gather_lists(comm, std::span<const LentRows>(mine))) {
    all.insert(all.end(), list.begin(), list.end());
  }
  const bool is_whole = std::ranges::find(all, -1, &LentRows::owner) == all.end();
  if (is_whole) return_light(comm, work.samples, all);
  return_ms_ = watch.ms();
  return is_whole;
}

void LightLending::return_light(Communicator& comm, std::span<const ShadedSample> samples,
                                std::span<const LentRows> all) {
  const auto ranks = static_cast<std::size_t>(comm.size());
  std::vector<std::vector<std::byte>> messages(ranks);
  std::vector<std::vector<LentRows>> arriving(ranks);
  const auto append = [&](const LentRows& rows) {
    std::vector<std::byte>& message = messages[static_cast<std::size_t>(rows.owner)];
    each_span(samples, rows,
              [&](std::span<std::byte> bytes) { message.insert(message.end(), bytes.begin(), bytes.end()); });
  };
  for (const LentRows& rows : all) {
    if (rows.lit_by == comm.rank()) append(rows);
    if (rows.owner != comm.rank()) continue;
    arriving[static_cast<std::size_t>(rows.lit_by)].push_back(rows);
    lent_.push_back(rows);
  }
  std::vector<Outgoing> out;
  std::vector<int> from;
  for (int rank = 0; rank < comm.size(); ++rank) {
    const auto peer = static_cast<std::size_t>(rank);
    if (!messages[peer].empty()) out.push_back({rank, messages[peer]});
    if (!arriving[peer].empty()) from.push_back(rank);
  }
  comm.exchange(out, from, [&](int peer, std::span<const std::byte> message) {
    const auto copy = [&](std::span<std::byte> bytes) {
      HPR_CHECK(bytes.size() <= message.size());
      std::ranges::copy(message.first(bytes.size()), bytes.begin());
      message = message.subspan(bytes.size());
    };
    for (const LentRows& rows : arriving[static_cast<std::size_t>(peer)]) each_span(samples, rows, copy);
  });
}

}  // namespace hpr
