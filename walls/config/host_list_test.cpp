#include <gtest/gtest.h>

#include "core/error.h"
#include "walls/config/wall_template.h"

namespace hpr {
namespace {

using Hosts = std::vector<std::string>;

TEST(HostList, ExpandsRangesAsSlurmWritesThem) {
  EXPECT_EQ(parse_host_list("wall01"), (Hosts{"wall01"}));
  EXPECT_EQ(parse_host_list("wall0[1-3]"), (Hosts{"wall01", "wall02", "wall03"}));
  EXPECT_EQ(parse_host_list("a[01-03,07],b2"), (Hosts{"a01", "a02", "a03", "a07", "b2"}));
  EXPECT_EQ(parse_host_list("n[8-11]"), (Hosts{"n8", "n9", "n10", "n11"}));
  EXPECT_EQ(parse_host_list("n[0]-ib"), (Hosts{"n0-ib"}));
}

TEST(HostList, KeepsTheWidthOfPaddedNumbers) {
  EXPECT_EQ(parse_host_list("n[08-10]"), (Hosts{"n08", "n09", "n10"}));
  EXPECT_EQ(parse_host_list("n[099-101]"), (Hosts{"n099", "n100", "n101"}));
  EXPECT_EQ(parse_host_list("n[9-10,00]"), (Hosts{"n9", "n10", "n00"}));
}

TEST(HostList, SeveralBracketsCountTheLastOneFastest) {
  EXPECT_EQ(parse_host_list("r[1-2]n[0-1].lab"), (Hosts{"r1n0.lab", "r1n1.lab", "r2n0.lab", "r2n1.lab"}));
}

TEST(HostList, RefusesWhatIsNoList) {
  for (const char* const bad : {"",
                                ",",
                                "a,",
                                "a,,b",
                                "a[",
                                "a]",
                                "a[1",
                                "a1]",
                                "a[]",
                                "a[1-]",
                                "a[-1]",
                                "a[1-2-3]",
                                "a[x]",
                                "a[1,]",
                                "a[3-1]",
                                "a[01-3]",
                                "a[[1]]",
                                "a b",
                                "a;b",
                                "-a",
                                ".a",
                                "a,a",
                                "a[1-3],a2",
                                "a[0-4096]",
                                "a[1-99999999999]",
                                "a[0-99][0-99]",
                                "a[+1]",
                                "a[0-2147483647]",
                                "a[1-2",
                                "a[1,b]"}) {
    try {
      (void)parse_host_list(bad);
      ADD_FAILURE() << "'" << bad << "' was taken for a list";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::Usage) << bad;
      EXPECT_FALSE(error.hint().empty()) << bad;
    }
  }
}

}  // namespace
}  // namespace hpr
