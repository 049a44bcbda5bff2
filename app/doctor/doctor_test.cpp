#include "app/doctor/doctor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <stdexcept>
#include <string>

#include "core/error.h"
#include "core/json.h"
#include "gpu/device/gpu_device.h"

namespace hpr {
namespace {

std::vector<Finding> some_findings() {
  const std::vector<Check> checks{
      {"fine",
       [] {
         return Finding{{}, FindingStatus::Ok, "all there", {}};
       }},
      {"slow",
       [] {
         return Finding{{}, FindingStatus::Warn, "half there", "apt-get install more"};
       }},
      {"broken", []() -> Finding { throw Error(ExitCode::NoDevice, "nothing there", "buy one"); }},
      {"odd", []() -> Finding { throw std::runtime_error("not ours"); }},
  };
  return examine(checks);
}

TEST(Doctor, AThrowingCheckIsRedWithItsHintAsTheRemedy) {
  const std::vector<Finding> findings = some_findings();
  ASSERT_EQ(findings.size(), 4U);
  EXPECT_EQ(findings[2].name, "broken");
  EXPECT_EQ(findings[2].status, FindingStatus::Fail);
  EXPECT_EQ(findings[2].detail, "nothing there");
  EXPECT_EQ(findings[2].remedy, "buy one");
  EXPECT_EQ(findings[3].status, FindingStatus::Fail);
}

TEST(Doctor, OnlyRedFindingsMakeAMachineUnfit) {
  const std::vector<Finding> findings = some_findings();
  EXPECT_FALSE(healthy(findings));
  EXPECT_TRUE(healthy(std::span(findings).first(2))) << "a warning does not";
  EXPECT_TRUE(healthy({}));
}

TEST(Doctor, TextIsAlignedAndColoredOnlyWhenAsked) {
  const std::vector<Finding> findings = some_findings();
  const std::string plain = findings_text(findings, false);
  EXPECT_EQ(plain.find('\x1b'), std::string::npos);
  EXPECT_NE(plain.find("ok    fine    all there\n"), std::string::npos) << plain;
  EXPECT_NE(plain.find("warn  slow    half there\n              -> apt-get install more\n"), std::string::npos)
      << plain;
  const std::string colored = findings_text(findings, true);
  EXPECT_NE(colored.find("\x1b[31mfail\x1b[0m"), std::string::npos);
  EXPECT_NE(colored.find("\x1b[32mok"), std::string::npos);
}

TEST(Doctor, JsonHoldsEveryFinding) {
  const auto json = Json::parse(findings_json(some_findings()));
  EXPECT_EQ(json["schema"], "hpr.doctor/1");
  EXPECT_EQ(json["healthy"], false);
  ASSERT_EQ(json["findings"].size(), 4U);
  EXPECT_EQ(json["findings"][1]["status"], "warn");
  EXPECT_EQ(json["findings"][1]["remedy"], "apt-get install more");
}

TEST(Doctor, MachineChecksEndWithAFindingEachAndARemedyWhereSomethingIsWrong) {
  std::vector<Check> checks = machine_checks();
  // Embree's own threads are no business of the sanitizers this test runs under.
  std::erase_if(checks, [](const Check& check) { return check.name == "Embree"; });
  std::set<std::string> names;
  for (const Finding& finding : examine(checks)) {
    EXPECT_TRUE(names.insert(finding.name).second) << finding.name;
    EXPECT_FALSE(finding.detail.empty()) << finding.name;
    EXPECT_EQ(finding.detail.find('\n'), std::string::npos) << finding.name;
    EXPECT_EQ(finding.remedy.empty(), finding.status == FindingStatus::Ok) << finding.name << ": " << finding.remedy;
  }
  EXPECT_GE(names.size(), 8U);
}

TEST(Doctor, LooksAtTheFolderWhereTemporaryFilesGo) {
  const char* const before = std::getenv("TMPDIR");
  const std::string old = before == nullptr ? "" : before;
  ::setenv("TMPDIR", "/nonexistent/folder", 1);
  const std::vector<Check> checks = machine_checks();
  const auto check = std::ranges::find(checks, "temporary files", &Check::name);
  ASSERT_NE(check, checks.end());
  const Finding finding = check->run();
  ::setenv("TMPDIR", old.c_str(), 1);
  EXPECT_EQ(finding.status, FindingStatus::Warn);
  EXPECT_NE(finding.detail.find("/nonexistent/folder"), std::string::npos) << finding.detail;
  EXPECT_NE(finding.remedy.find("TMPDIR"), std::string::npos) << finding.remedy;
}

GpuInfo card(bool software, const std::string& lacks) {
  GpuInfo info;
  info.index = 3;
  info.name = "card";
  info.driver = "580";
  info.memory = std::uint64_t{80} << 30U;
  info.software = software;
  info.lacks = lacks;
  return info;
}

TEST(Doctor, SaysWhatDevicesAreUsedFor) {
  const DeviceFinding good = judge(card(false, ""));
  EXPECT_EQ(good.use, (std::vector<std::string>{"keys", "light"}));
  EXPECT_EQ(good.backend, "auto");
  EXPECT_EQ(good.why, "");
  EXPECT_EQ(judge(card(true, "")).backend, "vulkan") << "software is used where it is asked for";
  const DeviceFinding lacking = judge(card(false, "shaderFloat64"));
  EXPECT_TRUE(lacking.use.empty() && lacking.backend.empty());
  EXPECT_EQ(lacking.why, "lacks shaderFloat64");

  std::vector<Finding> findings{{"Vulkan", FindingStatus::Ok, "2 devices", {}, {good, lacking}}};
  const std::string text = findings_text(findings, false);
  EXPECT_NE(text.find("3: card, driver 580, 80 GiB: keys and light by --backend auto\n"), std::string::npos) << text;
  EXPECT_NE(text.find("of no use (lacks shaderFloat64)\n"), std::string::npos) << text;
  const Json all = Json::parse(findings_json(findings));
  const Json& json = all["findings"][0]["devices"];
  ASSERT_EQ(json.size(), 2U);
  ASSERT_EQ(json[0]["use"].size(), 2U);
  EXPECT_EQ(json[0]["use"][1].get<std::string>(), "light");
  EXPECT_EQ(json[0]["memory_bytes"].get<std::uint64_t>(), 85899345920U);
  EXPECT_TRUE(json[1]["backend"].is_null());
  EXPECT_EQ(json[1]["why"].get<std::string>(), "lacks shaderFloat64");
  findings.front().devices.clear();
  EXPECT_FALSE(Json::parse(findings_json(findings))["findings"][0].contains("devices"))
      << "what other findings have not";
}

}  // namespace
}  // namespace hpr
