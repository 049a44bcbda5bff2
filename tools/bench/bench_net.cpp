#include <mpi.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <utility>
#include <vector>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "app/launch/run_ranks.h"
#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator.h"
#include "compositing/kernels.h"
#include "compositing/model/synthetic.h"
#include "compositing/tile_codec.h"
#include "core/job_environment.h"
#include "image/tiles.h"
#include "tools/bench/bench.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

constexpr int kRepetitions = 21;
constexpr double kCopyOfIceTsMachine = 4.5;  // ms
constexpr std::size_t kCopyBytes = std::size_t{64} << 20U;
constexpr std::size_t kLargeMessage = std::size_t{8} << 20U;
constexpr int kPings = 500;

/// The median time of repetitions on a clock.
double median_ms(const std::function<void()>& work) {
  return median_times({work}, {1, kRepetitions}).front();
}

double gigabytes_per_second(std::size_t bytes, double ms) {
  return static_cast<double>(bytes) / 1e6 / ms;
}

BenchRow copy_row() {
  const std::vector<std::byte> from(kCopyBytes, std::byte{1});
  std::vector<std::byte> into(kCopyBytes);
  const double ms = median_ms([&] { std::memcpy(into.data(), from.data(), from.size()); });
  return {"copy of 64 MiB (floor: IceT's machine)", ms, kCopyOfIceTsMachine, "ms", kCopyOfIceTsMachine / ms};
}

/// A merge of n keys moves 3 n words, as a copy of 1.5 n keys does.
BenchRow merge_row() {
  constexpr std::size_t kKeys = std::size_t{1920} * 1080;
  std::vector<Key> into(kKeys, 1);
  const std::vector<Key> from(kKeys, 2);
  const std::vector<Key> half(kKeys * 3 / 2, 3);
  std::vector<Key> copied(half.size());
  const double ours = median_ms([&] { merge_keys(into, from); });
  const double floor = median_ms([&] { std::ranges::copy(half, copied.begin()); });
  return {"merge of 1080p keys (floor: a copy)", ours, floor, "ms", floor / ours};
}

/// `there` and `back` between ranks 0 and 1, half of it in microseconds.
double ping_us(Communicator& comm, const std::function<void()>& send, const std::function<void()>& receive) {
  const double ms = median_ms([&] {
    for (int i = 0; i < kPings; ++i) {
      if (comm.rank() == 0) send();
      if (comm.rank() <= 1) receive();
      if (comm.rank() == 1) send();
    }
  });
  return ms * 1e3 / kPings / 2.0;
}

BenchRow message_row(Communicator& comm) {
  std::uint64_t word = 0;
  const int peer = 1 - comm.rank();
  const double ours = ping_us(
      comm, [&] { comm.send(std::as_bytes(std::span(&word, 1)), peer); },
      [&] { comm.receive(std::as_writable_bytes(std::span(&word, 1)), peer); });
  const double floor = ping_us(
      comm, [&] { MPI_Send(&word, 1, MPI_UINT64_T, peer, 0, MPI_COMM_WORLD); },
      [&] { MPI_Recv(&word, 1, MPI_UINT64_T, peer, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE); });
  return {"message of 8 bytes (floor: plain MPI)", ours, floor, "us", floor / ours};
}

BenchRow large_message_row(Communicator& comm) {
  std::vector<std::byte> bytes(kLargeMessage);
  const double ours = median_ms([&] {
    barrier(comm);
    if (comm.rank() == 1) comm.send(bytes, 0);
    if (comm.rank() == 0) comm.receive(bytes, 1);
  });
  const double floor = median_ms([&] {
    barrier(comm);
    const int count = static_cast<int>(bytes.size());
    if (comm.rank() == 1) MPI_Send(bytes.data(), count, MPI_BYTE, 0, 0, MPI_COMM_WORLD);
    if (comm.rank() == 0) MPI_Recv(bytes.data(), count, MPI_BYTE, 1, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  });
  return {"message of 8 MiB (floor: plain MPI)", gigabytes_per_second(kLargeMessage, ours),
          gigabytes_per_second(kLargeMessage, floor), "GB/s", floor / ours};
}

/// A layer of dense tiles sent by rank 1 and merged by rank 0, beside a copy of its bytes.
BenchRow tiles_row(Communicator& comm) {
  const FrameLayout layout({{1920, 1080}});
  TileLayer<Key> layer(layout);
  draw_everywhere(layer, comm.rank());
  const std::vector<std::size_t> tiles = all_tiles(layout);
  TileMessage message;
  TileReader reader;
  const int sender = 1;
  const double ours = median_ms([&] {
    barrier(comm);
    if (comm.rank() == 1) {
      message.send(comm, layer, tiles, 0);
    } else if (comm.rank() == 0) {
      comm.exchange({}, {&sender, 1}, [&](int from, std::span<const std::byte> arrived) {
        reader.merge(comm, from, arrived, layer, tiles);
      });
    }
  });
  const std::size_t bytes = tiles.size() * kTilePixels * sizeof(Key);
  const std::vector<std::byte> from(bytes, std::byte{1});
  std::vector<std::byte> into(bytes);
  const double floor = median_ms([&] { std::memcpy(into.data(), from.data(), bytes); });
  return {"1080p layer sent and merged (floor: a copy)", gigabytes_per_second(bytes, ours),
          gigabytes_per_second(bytes, floor), "GB/s", floor / ours};
}

/// What messages and merging cost on this machine. Collective over two or more ranks of an MPI job; the rows stand on
/// rank 0. Its first row, a copy of 64 MiB by one thread, beside the 4.5 ms it took where the compositing times of IceT
/// in docs/measurements.md were measured, scales those to this machine. Takes about a second.
std::vector<BenchRow> bench_net(Communicator& comm) {
  std::vector<BenchRow> rows;
  if (comm.rank() == 0) {  // alone, while the others wait for the first message
    rows.push_back(copy_row());
    rows.push_back(merge_row());
  }
  barrier(comm);
  rows.push_back(message_row(comm));
  rows.push_back(large_message_row(comm));
  rows.push_back(tiles_row(comm));
  return comm.rank() == 0 ? rows : std::vector<BenchRow>{};
}

class BenchNetCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "net"; }
  [[nodiscard]] std::string_view summary() const override {
    return "messages, merging and copying between two ranks, against plain MPI and a copy";
  }

  void declare(const OptionSet& options) override { options.flag("--json", json_, "one JSON document"); }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    Globals pair = globals;
    if (pair.ranks == 0 && !inside_mpi_job()) pair.ranks = 2;
    if (pair.ranks == 1)
      throw Error(ExitCode::Usage, "bench net needs two ranks", "leave --ranks out, or say --ranks 2");
    return run_ranks(pair, [&](Communicator& comm) {
      if (comm.size() < 2) throw Error(ExitCode::Usage, "bench net needs two ranks", "mpirun -n 2 hpr bench net");
      const std::vector<BenchRow> rows = bench_net(comm);
      if (comm.rank() == 0) print_bench(rows, this_machine().cpu, json_);
      return ExitCode::Done;
    });
  }

 private:
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> make_bench_net_command() {
  return std::make_unique<BenchNetCommand>();
}

}  // namespace hpr
