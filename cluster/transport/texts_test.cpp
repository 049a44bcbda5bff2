#include "cluster/transport/texts.h"

#include <gtest/gtest.h>

#include "cluster/transport/local_communicator.h"

namespace hpr {
namespace {

/// Of different lengths, that of rank 1 empty, those of others with a zero in them.
std::string text_of(int rank) {
  std::string text;
  for (int i = 1; i < rank; ++i) text += std::string("a\0b", 3);
  return rank == 0 ? "of rank 0" : text;
}

TEST(Texts, OfRankZeroReachEveryRank) {
  run_local_ranks(5, [](Communicator& comm) { EXPECT_EQ(broadcast_text(comm, text_of(comm.rank())), "of rank 0"); });
  run_local_ranks(3, [](Communicator& comm) { EXPECT_EQ(broadcast_text(comm, ""), ""); });
}

TEST(Texts, OfEveryRankStandInTheirOrder) {
  run_local_ranks(5, [](Communicator& comm) {
    const std::vector<std::string> texts = all_gather_texts(comm, text_of(comm.rank()));
    ASSERT_EQ(texts.size(), 5U);
    for (int rank = 0; rank < 5; ++rank) EXPECT_EQ(texts[static_cast<std::size_t>(rank)], text_of(rank));
  });
}

}  // namespace
}  // namespace hpr
