#include "core/text.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

namespace hpr {
namespace {

const std::vector<std::string> kChoices{"serial", "tree", "binary-swap", "mpi-reduce"};

TEST(Names, TheNearestChoiceIsFewestEditsAway) {
  EXPECT_EQ(nearest_name("tre", kChoices), "tree");    // insertion
  EXPECT_EQ(nearest_name("treee", kChoices), "tree");  // deletion
  EXPECT_EQ(nearest_name("trie", kChoices), "tree");   // substitution
  EXPECT_EQ(nearest_name("tere", kChoices), "tree");   // one swap of neighbours
  EXPECT_EQ(nearest_name("binray-swap", kChoices), "binary-swap");
  EXPECT_EQ(nearest_name("tree", kChoices), "tree");
}

TEST(Names, ASwapOfNeighboursCountsAsOneEdit) {
  const std::vector<std::string> choices{"ab"};
  EXPECT_EQ(nearest_name("ba", choices), "ab");  // two substitutions would be more than a third
}

TEST(Names, NothingIsNearestWhenMoreThanAThirdDiffers) {
  EXPECT_EQ(nearest_name("xyz", kChoices), std::nullopt);
  EXPECT_EQ(nearest_name("txx", {std::vector<std::string>{"tree", "abc"}}), std::nullopt);
  EXPECT_EQ(nearest_name("radix-k", kChoices), std::nullopt);
  EXPECT_EQ(nearest_name("tree", {}), std::nullopt);
  EXPECT_EQ(nearest_name(std::string(100000, 'a'), kChoices), std::nullopt);
}

TEST(Names, TheFirstOfEquallyNearChoicesWins) {
  EXPECT_EQ(nearest_name("bat", {std::vector<std::string>{"cat", "hat"}}), "cat");
}

TEST(Names, TheHintNamesTheNearestAndAllChoices) {
  EXPECT_EQ(unknown_name_hint("tre", kChoices), "did you mean 'tree'? choices: serial, tree, binary-swap, mpi-reduce");
  EXPECT_EQ(unknown_name_hint("zzzzz", kChoices), "choices: serial, tree, binary-swap, mpi-reduce");
}

TEST(Names, PrintableKeepsTextAndWritesControlCodesAsHex) {
  EXPECT_EQ(printable("sphere 1"), "sphere 1");
  EXPECT_EQ(printable("K\xC3\xBC\x63he \xE2\x82\xAC \xF0\x9F\x98\x80"),
            "K\xC3\xBC\x63he \xE2\x82\xAC \xF0\x9F\x98\x80");
  EXPECT_EQ(printable("\x1B[31m"), "\\x1b[31m");
  EXPECT_EQ(printable("a\nb\tc"), "a\\x0ab\\x09c");
  EXPECT_EQ(printable(std::string_view("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(printable("\x7F"), "\\x7f");
  EXPECT_EQ(printable("\xC2\x9B"
                      "31m"),
            "\\xc2\\x9b31m");  // U+009B: one-byte CSI
}

TEST(Names, PrintableWritesDirectionChangesAsHex) {
  EXPECT_EQ(printable("\xE2\x80\xAE"
                      "gpj.exe"),
            "\\xe2\\x80\\xaegpj.exe");                      // U+202E
  EXPECT_EQ(printable("\xE2\x81\xA6"), "\\xe2\\x81\\xa6");  // U+2066
  EXPECT_EQ(printable("\xE2\x80\x8F"), "\\xe2\\x80\\x8f");  // U+200F
  EXPECT_EQ(printable("\xD8\x9C"), "\\xd8\\x9c");           // U+061C
  EXPECT_EQ(printable("\xE2\x80\xA8"), "\\xe2\\x80\\xa8");  // U+2028, a line separator
}

TEST(Names, PrintableWritesWhatIsNoUtf8AsHex) {
  EXPECT_EQ(printable("a\xFFz"), "a\\xffz");
  EXPECT_EQ(printable("\x80"), "\\x80");           // lone continuation
  EXPECT_EQ(printable("\xE2\x82"), "\\xe2\\x82");  // cut short
  EXPECT_EQ(printable("\xC3z"), "\\xc3z");
  EXPECT_EQ(printable("\xC0\xAF"), "\\xc0\\xaf");           // overlong in two bytes
  EXPECT_EQ(printable("\xE0\x80\xAF"), "\\xe0\\x80\\xaf");  // overlong in three
  EXPECT_EQ(printable("\xF0\x80\x80\xAF"), "\\xf0\\x80\\x80\\xaf");
  EXPECT_EQ(printable("\xED\xA0\x80"), "\\xed\\xa0\\x80");           // surrogate
  EXPECT_EQ(printable("\xF4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");  // past U+10FFFF
}

TEST(Names, PrintableCutsAtTheLimitButNeverInsideACharacter) {
  EXPECT_EQ(printable("abcdef", 6), "abcdef");
  EXPECT_EQ(printable("abcdefg", 6), "abcdef...");
  EXPECT_EQ(printable("abc\xE2\x82\xAC", 5), "abc...");
  EXPECT_EQ(printable("abc\n", 5), "abc...");
}

using std::chrono::nanoseconds;

TEST(Units, BytesTakeBinaryAndDecimalUnits) {
  EXPECT_EQ(parse_bytes("0"), 0U);
  EXPECT_EQ(parse_bytes("512"), 512U);
  EXPECT_EQ(parse_bytes("512B"), 512U);
  EXPECT_EQ(parse_bytes("64KiB"), 65536U);
  EXPECT_EQ(parse_bytes("64K"), 65536U);
  EXPECT_EQ(parse_bytes("64kB"), 64000U);
  EXPECT_EQ(parse_bytes("1.5GB"), 1'500'000'000U);
  EXPECT_EQ(parse_bytes("2G"), std::uint64_t{2} << 30U);
  EXPECT_EQ(parse_bytes("1 TiB"), std::uint64_t{1} << 40U);
}

TEST(Units, BytesRefuseWhatIsNoSize) {
  for (const char* text :
       {"", "GB", "-1", "1X", "1GBB", "nan", "inf", "1e400", "1e30", "9000000TiB", "0x10", " 1", "+1"}) {
    EXPECT_EQ(parse_bytes(text), std::nullopt) << text;
  }
}

TEST(Units, BytesAreWrittenInAFittingUnitAndReadBack) {
  EXPECT_EQ(format_bytes(0), "0 B");
  EXPECT_EQ(format_bytes(1023), "1023 B");
  EXPECT_EQ(format_bytes(1024), "1 KiB");
  EXPECT_EQ(format_bytes(294912), "288 KiB");
  EXPECT_EQ(format_bytes((1U << 20U) - 1), "1 MiB");
  EXPECT_EQ(format_bytes(std::uint64_t{3} << 29U), "1.5 GiB");
  EXPECT_EQ(format_bytes(UINT64_MAX), "16 EiB");
  EXPECT_EQ(parse_bytes(format_bytes(std::uint64_t{5} << 39U)), std::uint64_t{5} << 39U);
}

TEST(Units, DurationsTakeUnitsAndBareSeconds) {
  EXPECT_EQ(parse_duration("2us"), nanoseconds(2000));
  EXPECT_EQ(parse_duration("33ms"), nanoseconds(33'000'000));
  EXPECT_EQ(parse_duration("1.5s"), nanoseconds(1'500'000'000));
  EXPECT_EQ(parse_duration("2min"), nanoseconds(120'000'000'000));
  EXPECT_EQ(parse_duration("3"), nanoseconds(3'000'000'000));
  for (const char* text : {"", "s", "-1s", "1h2", "nan", "1e20"}) EXPECT_EQ(parse_duration(text), std::nullopt) << text;
}

TEST(Units, ExtentsAreTwoPositiveIntegers) {
  EXPECT_EQ(parse_extent("1920x1080"), (std::pair{1920, 1080}));
  EXPECT_EQ(parse_extent("1x1"), (std::pair{1, 1}));
  for (const char* text : {"", "x", "1x", "x1", "0x1", "1x0", "-1x2", "1x-2", "1X2", "1x2x3", "1x2 ", " 1x2", "1.5x2",
                           "99999999999x1", "1x99999999999"}) {
    EXPECT_EQ(parse_extent(text), std::nullopt) << text;
  }
}

TEST(ShellLine, QuotesWhatAShellWouldTakeApart) {
  const std::array<std::string, 6> words{"hpr", "render", "my scene.glb", "--environment=1,1,1", "gen:rods?n=3", ""};
  EXPECT_EQ(shell_line(words), "hpr render 'my scene.glb' --environment=1,1,1 'gen:rods?n=3' ''");
  EXPECT_EQ(shell_quote("it's"), R"('it'\''s')");
}

}  // namespace

}  // namespace hpr
