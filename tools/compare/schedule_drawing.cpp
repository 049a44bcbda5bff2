#include "tools/compare/schedule_drawing.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "compositing/compositor.h"
#include "tools/report/canvas.h"

namespace hpr {
namespace {

constexpr std::size_t kTileBytes = kTilePixels * sizeof(Key);
constexpr double kLeft = 62.0;      ///< room for the ranks' names
constexpr double kTop = 44.0;       ///< for the rounds'
constexpr double kBetween = 22.0;   ///< from compositing to collecting
constexpr double kLineHeight = 14;  ///< of text
constexpr std::size_t kMaxDescribed = 64;
constexpr int kMaxRanksDrawn = 16;
// Colors of Okabe and Ito's palette, which color-blind people distinguish; lines differ in their dashes too.
constexpr std::string_view kTiles = "#0072B2";
constexpr std::string_view kSmall = "#6b6b6b";
constexpr std::string_view kReduced = "#A03C00";
constexpr std::string_view kHost = "#F3DFA2";
constexpr std::string_view kHostEdge = "#8A6A00";
constexpr std::string_view kFaint = "#c8c8c8";

/// What one column shows.
struct Column {
  std::string_view phase;  ///< above the first column of compositing, and of collecting
  std::vector<Transfer> transfers;
  std::vector<Barrier> barriers;
  std::vector<InPlaceWork> works;
};

std::vector<Column> columns_of(const Schedule& schedule, std::string_view phase) {
  std::vector<Column> columns(static_cast<std::size_t>(schedule.rounds));
  if (!columns.empty()) columns.front().phase = phase;
  const auto at = [&](int round) -> Column& { return columns[static_cast<std::size_t>(round)]; };
  for (const Transfer& transfer : schedule.transfers) at(transfer.round).transfers.push_back(transfer);
  for (const Barrier& barrier : schedule.barriers) at(barrier.round).barriers.push_back(barrier);
  for (const InPlaceWork& work : schedule.works) at(work.round).works.push_back(work);
  return columns;
}

/// Messages of about one size, as a column's caption counts them.
std::string count_of(const std::vector<std::size_t>& bytes) {
  const std::size_t min_bytes = *std::ranges::min_element(bytes);
  const std::size_t max_bytes = *std::ranges::max_element(bytes);
  if (max_bytes == 0) return fmt::format("{} × empty", bytes.size());
  if (max_bytes < kTileBytes) {
    return min_bytes == max_bytes ? fmt::format("{} × {} B", bytes.size(), max_bytes)
                                  : fmt::format("{} × {}–{} B", bytes.size(), min_bytes, max_bytes);
  }
  const std::size_t min_tiles = min_bytes / kTileBytes;
  const std::size_t max_tiles = max_bytes / kTileBytes;
  if (min_tiles == max_tiles) return fmt::format("{} × {} tile{}", bytes.size(), max_tiles, max_tiles == 1 ? "" : "s");
  return fmt::format("{} × {}–{} tiles", bytes.size(), min_tiles, max_tiles);
}

/// Lines of text below a column: whole tiles, then what is smaller, then what is empty.
std::vector<std::string> captions(const Column& column) {
  std::vector<std::size_t> tiles;
  std::vector<std::size_t> small;
  std::vector<std::size_t> empty;
  for (const Transfer& transfer : column.transfers) {
    (transfer.bytes >= kTileBytes ? tiles : transfer.bytes > 0 ? small : empty).push_back(transfer.bytes);
  }
  std::vector<std::string> lines;
  for (const auto& sizes : {tiles, small, empty}) {
    if (!sizes.empty()) lines.push_back(count_of(sizes));
  }
  std::size_t merged = 0;
  for (const InPlaceWork& work : column.works) merged += work.bytes / kTileBytes;
  if (merged > 0) lines.push_back(fmt::format("{} tiles read", merged));
  if (!column.barriers.empty()) lines.emplace_back("meet");
  return lines;
}

double width_of(const Column& column) {
  std::size_t max_length = 0;
  for (const std::string& caption : captions(column)) max_length = std::max(max_length, caption.size());
  const double arrows = 50.0 + std::min(110.0, 1.6 * static_cast<double>(column.transfers.size()));
  return std::max(arrows, 6.4 * static_cast<double>(max_length) + 6.0);
}

/// "round 1: 0 to 1 and 1 to 0 (32 tiles); ..." for those who cannot see the drawing.
std::string describe(const std::vector<Column>& columns) {
  std::string text;
  std::size_t described = 0;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const Column& column = columns[i];
    if (!column.phase.empty()) text += fmt::format("{}: ", column.phase);
    text += fmt::format("round {}: {}", i + 1, fmt::join(captions(column), ", "));
    described += column.transfers.size();
    if (described <= kMaxDescribed) {
      for (const Transfer& transfer : column.transfers) text += fmt::format(", {} to {}", transfer.from, transfer.to);
    }
    text += "; ";
  }
  return text.empty() ? "Nothing is sent." : text;
}

class Sheet {
 public:
  Sheet(std::string_view name, const RecordedFrame& frame)
      : ranks_(frame.composite.ranks), columns_(columns_of(frame.composite, "composite")) {
    const auto collecting = columns_of(frame.collect, "collect on rank 0");
    columns_.insert(columns_.end(), collecting.begin(), collecting.end());
    // The phase's name must find room above its first column.
    double x = kLeft;
    for (const Column& column : columns_) {
      if (!column.phase.empty() && x > kLeft) x += kBetween;
      lefts_.push_back(x);
      x += width_of(column);
    }
    width_ = std::max(x + 24.0, lefts_.empty() ? 0.0 : lefts_.back() + 150.0);
    std::size_t lines = 0;
    for (const Column& column : columns_) lines = std::max(lines, captions(column).size());
    height_ = kTop + row_height() * ranks_ + kLineHeight * static_cast<double>(lines) + 12.0;
    canvas_.emplace(width_, height_, fmt::format("{} on {} ranks: who sends what to whom", name, ranks_),
                    describe(columns_));
    layer_bytes_ = static_cast<double>(frame.tiles * kTileBytes);
  }

  std::string draw() {
    draw_rows();
    for (std::size_t i = 0; i < columns_.size(); ++i) draw_column(i);
    if (columns_.empty()) canvas_->text({kLeft + 8, kTop + 4}, "nothing is sent");
    return canvas_->str();
  }

 private:
  [[nodiscard]] double row_height() const { return ranks_ <= 8 ? 26.0 : 19.0; }
  [[nodiscard]] double y_of(int rank) const { return kTop + row_height() * (rank + 0.5); }

  void draw_rows() {
    if (!columns_.empty()) canvas_->text({kLeft - 10, 34}, "round", Anchor::End, 11);
    for (int rank = 0; rank < ranks_; ++rank) {
      const std::string name = fmt::format("rank {}", rank);
      canvas_->text({kLeft - 10, y_of(rank) + 4}, name, Anchor::End);
      canvas_->line({kLeft - 6, y_of(rank)}, {width_ - 8, y_of(rank)}, {kFaint, 1.0});
    }
  }

  void draw_column(std::size_t index) {
    const Column& column = columns_[index];
    const double left = lefts_[index];
    const double width = width_of(column);
    const double bottom = y_of(ranks_ - 1) + row_height() / 2;
    if (!column.phase.empty()) {
      canvas_->text({left, 16}, column.phase, Anchor::Start, 12, true);
      if (index > 0) canvas_->line({left - kBetween / 2, 6}, {left - kBetween / 2, bottom}, {kSmall, 1.0, "4 3"});
    }
    const double center = left + width / 2;
    canvas_->text({center, 34}, fmt::format("{}", index + 1), Anchor::Middle, 11);
    for (const Barrier& barrier : column.barriers) draw_barrier(barrier, center);
    for (const InPlaceWork& work : column.works) draw_work(work, center);
    // The wide ones first, so that none hides.
    std::vector<Transfer> transfers = column.transfers;
    std::ranges::stable_sort(transfers, std::greater{}, &Transfer::bytes);
    for (const Transfer& transfer : transfers) {
      canvas_->arrow({left + 7, y_of(transfer.from)}, {left + width - 7, y_of(transfer.to)}, stroke_of(transfer));
    }
    double y = bottom + kLineHeight;
    for (const std::string& line : captions(column)) {
      canvas_->text({center, y}, line, Anchor::Middle, 11);
      y += kLineHeight;
    }
  }

  [[nodiscard]] Stroke stroke_of(const Transfer& transfer) const {
    if (transfer.reduced) return {kReduced, 2.0, "6 3"};
    if (transfer.bytes < kTileBytes) return {kSmall, 0.9, transfer.bytes == 0 ? "1 3" : "3 2"};
    return {kTiles, 0.8 + 3.0 * std::sqrt(static_cast<double>(transfer.bytes) / layer_bytes_)};
  }

  void draw_barrier(const Barrier& barrier, double x) {
    const double top = y_of(barrier.ranks.front());
    const double bottom = y_of(barrier.ranks.back());
    canvas_->line({x, top - 6}, {x, bottom + 6}, {kHostEdge, 3.0});
    for (const int rank : barrier.ranks) canvas_->circle({x, y_of(rank)}, 4.5, kHost, {kHostEdge, 1.5});
  }

  void draw_work(const InPlaceWork& work, double x) {
    const double top = y_of(work.ranks.front()) - 9;
    const double bottom = y_of(work.ranks.back()) + 9;
    canvas_->rectangle({x - 14, top}, 28, bottom - top, kHost, {kHostEdge, 1.5});
    const bool tall = bottom - top > 100;
    canvas_->upright_text({x + 4, (top + bottom) / 2}, tall ? "merge in place" : "merge", 11);
  }

  int ranks_;
  std::vector<Column> columns_;
  std::vector<double> lefts_;
  double width_ = 0.0;
  double height_ = 0.0;
  double layer_bytes_ = 1.0;
  std::optional<SvgCanvas> canvas_;
};

/// What to draw a strategy on: the most ranks it was compared on, 16 in place of more; 0 when it does not run on those.
int ranks_to_draw(const Compositor& compositor, const std::vector<CompareRun>& runs) {
  int ranks_drawn = 0;
  for (const CompareRun& run : runs) {
    const int ranks = std::min(run.ranks, kMaxRanksDrawn);
    if (run.strategy == compositor.name() && compositor.fits(ranks)) ranks_drawn = std::max(ranks_drawn, ranks);
  }
  return ranks_drawn;
}

/// "tree, ring": what a strategy chose in its place, on whatever number of ranks.
std::string choices_of(std::string_view strategy, const std::vector<CompareRun>& runs) {
  std::vector<std::string> choices;
  for (const CompareRun& run : runs) {
    if (run.strategy != strategy || run.chosen.empty()) continue;
    if (std::ranges::find(choices, run.chosen) == choices.end()) choices.push_back(run.chosen);
  }
  return fmt::format("{}", fmt::join(choices, ", "));
}

StrategyDrawing draw_strategy(const std::string& strategy, const std::vector<CompareRun>& runs) {
  if (strategy == kSortFirst) return {strategy, 0, {}, "Every rank draws tiles of its own: only the collect is left."};
  const std::string choices = choices_of(strategy, runs);
  if (!choices.empty()) return {strategy, 0, {}, fmt::format("It chose {}.", choices)};
  const auto make = [&] { return make_compositor(strategy); };
  const int ranks = ranks_to_draw(*make(), runs);
  if (ranks == 0) {
    return {strategy, 0, {}, fmt::format("It runs on no number of ranks up to {} compared here.", kMaxRanksDrawn)};
  }
  return {strategy, ranks, draw_schedule(strategy, record_frame(make, {.size = ranks})), {}};
}

}  // namespace

std::string draw_schedule(std::string_view name, const RecordedFrame& frame) {
  return Sheet(name, frame).draw();
}

std::vector<StrategyDrawing> draw_strategies(const std::vector<CompareRun>& runs) {
  std::vector<StrategyDrawing> drawings;
  for (const CompareRun& run : runs) {
    if (std::ranges::find(drawings, run.strategy, &StrategyDrawing::strategy) != drawings.end()) continue;
    drawings.push_back(draw_strategy(run.strategy, runs));
  }
  return drawings;
}

}  // namespace hpr
