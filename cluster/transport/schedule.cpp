#include "cluster/transport/schedule.h"

#include <algorithm>
#include <map>

#include "core/error.h"

namespace hpr {
namespace {

/// Goes through the deeds of all ranks as far as each can without what others have not given yet, again and again.
class Replay {
 public:
  explicit Replay(std::span<const std::vector<Deed>> deeds) : deeds_(deeds), ranks_(deeds.size()) {
    schedule_.ranks = static_cast<int>(deeds.size());
  }

  Schedule run() {
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t rank = 0; rank < deeds_.size(); ++rank) {
        while (advance(rank)) moved = true;
      }
    }
    for (std::size_t rank = 0; rank < deeds_.size(); ++rank) HPR_CHECK(ranks_[rank].next == deeds_[rank].size());
    join_works();
    std::ranges::sort(schedule_.transfers);
    std::ranges::sort(schedule_.gatherings);
    auto& gatherings = schedule_.gatherings;
    gatherings.erase(std::unique(gatherings.begin(), gatherings.end()),
                     gatherings.end());  // every member has told of it
    return std::move(schedule_);
  }

 private:
  struct Progress {
    std::size_t next = 0;
    int round = 0;
    bool gave = false;  ///< what the next deed gives
  };
  struct Parcel {
    int round = 0;
    std::size_t bytes = 0;
  };

  /// Does a rank's next deed; false when there is none or it waits.
  bool advance(std::size_t rank) {
    Progress& progress = ranks_[rank];
    if (progress.next == deeds_[rank].size()) return false;
    const Deed& deed = deeds_[rank][progress.next];
    if (!progress.gave) {
      for (const auto& [ticket, bytes] : deed.given) parcels_[ticket] = {progress.round, bytes};
      progress.gave = true;
    }
    if (!std::ranges::all_of(deed.taken, [&](const Ticket& ticket) { return parcels_.contains(ticket); })) return false;
    int last = progress.round;
    for (const Ticket& ticket : deed.taken) {
      const Parcel& parcel = parcels_[ticket];
      const int round = std::max(progress.round, parcel.round);
      last = std::max(last, round);
      if (deed.kind == Deed::Kind::Gathering) continue;
      schedule_.transfers.push_back({round, ticket.from, ticket.to, parcel.bytes, deed.kind == Deed::Kind::Reduction});
    }
    if (deed.kind == Deed::Kind::Gathering) schedule_.gatherings.push_back({last, deed.ranks});
    if (deed.kind == Deed::Kind::InPlaceWork) schedule_.works.push_back({last, deed.ranks, deed.bytes});
    progress = {progress.next + 1, last + 1, false};
    schedule_.rounds = std::max(schedule_.rounds, last + 1);
    return true;
  }

  void join_works() {
    std::map<std::pair<int, std::vector<int>>, std::size_t> joined;
    for (const InPlaceWork& work : schedule_.works) joined[{work.round, work.ranks}] += work.bytes;
    schedule_.works.clear();
    for (const auto& [where, bytes] : joined) schedule_.works.push_back({where.first, where.second, bytes});
  }

  std::span<const std::vector<Deed>> deeds_;
  std::vector<Progress> ranks_;
  std::map<Ticket, Parcel> parcels_;
  Schedule schedule_;
};

}  // namespace

Schedule schedule_of(std::span<const std::vector<Deed>> deeds) {
  return Replay(deeds).run();
}

}  // namespace hpr
