#include "core/timing.h"

#include <gtest/gtest.h>

#include <barrier>
#include <cstddef>
#include <cstdint>
#include <set>

#include "core/parallel.h"

namespace hpr {
namespace {

TEST(Trace, RecordsWhatEndsWhileItRecords) {
  { const trace::Span before("before"); }
  trace::start();
  EXPECT_TRUE(trace::recording());
  {
    trace::Span outer("outer", "tile", 7);
    { const trace::Span inner("inner"); }
    outer.set_detail("bytes", 11);
  }
  const trace::Record record = trace::finish();
  EXPECT_FALSE(trace::recording());
  { const trace::Span after("after"); }
  ASSERT_EQ(record.events.size(), 2U);
  const trace::Event& inner = record.events[0];
  const trace::Event& outer = record.events[1];
  EXPECT_STREQ(inner.name, "inner");
  EXPECT_EQ(inner.detail, nullptr);
  EXPECT_STREQ(outer.name, "outer");
  EXPECT_STREQ(outer.detail, "bytes");
  EXPECT_EQ(outer.amount, 11U);
  EXPECT_LE(outer.begin_ns, inner.begin_ns);
  EXPECT_LE(inner.begin_ns, inner.end_ns);
  EXPECT_LE(inner.end_ns, outer.end_ns);
  EXPECT_EQ(record.dropped, 0U);
  EXPECT_TRUE(trace::finish().events.empty());
}

TEST(Trace, ASpanThatOutlivesTheRecordIsLeftOut) {
  trace::start();
  {
    const trace::Span late("late");
    EXPECT_TRUE(trace::finish().events.empty());
  }
  trace::start();
  EXPECT_TRUE(trace::finish().events.empty());
}

TEST(Trace, ThreadsOfALoopHaveRowsOfTheirOwn) {
  trace::start();
  const trace::InRow second({2, 0});
  std::barrier all(3);
  parallel_for(3, 3, [&](std::size_t i) {
    const trace::Span span("work", "item", i);
    all.arrive_and_wait();  // each has one
  });
  const trace::Record record = trace::finish();
  std::set<std::uint64_t> items;
  std::set<int> lanes;
  for (const trace::Event& event : record.events) {
    items.insert(event.amount);
    lanes.insert(event.lane);
    EXPECT_EQ(event.rank, 2);
  }
  EXPECT_EQ(items, (std::set<std::uint64_t>{0, 1, 2}));
  EXPECT_EQ(lanes, (std::set<int>{0, 1, 2}));
}

TEST(Trace, MoreThanItHoldsIsCounted) {
  trace::start();
  for (std::size_t i = 0; i < trace::kMaxEvents + 5; ++i) const trace::Span span("x");
  const trace::Record record = trace::finish();
  EXPECT_EQ(record.events.size(), trace::kMaxEvents);
  EXPECT_EQ(record.dropped, 5U);
}

}  // namespace
}  // namespace hpr
