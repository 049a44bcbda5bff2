#include "app/doctor/doctor.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <string_view>

#include "core/error.h"
#include "core/json.h"

namespace hpr {
namespace {

struct Look {
  std::string_view word;
  std::string_view color;
};

Look look_of(FindingStatus status) {
  switch (status) {
    case FindingStatus::Warn:
      return {"warn", "\x1b[33m"};
    case FindingStatus::Fail:
      return {"fail", "\x1b[31m"};
    case FindingStatus::Ok:
      break;
  }
  return {"ok", "\x1b[32m"};
}

Finding outcome(const Check& check) {
  try {
    return check.run();
  } catch (const Error& error) {
    return {{}, FindingStatus::Fail, error.what(), error.hint()};
  } catch (const std::exception& error) {
    return {{}, FindingStatus::Fail, error.what(), {}};
  }
}

}  // namespace

std::vector<Finding> examine(std::span<const Check> checks) {
  std::vector<Finding> findings;
  for (const Check& check : checks) {
    findings.push_back(outcome(check));
    findings.back().name = check.name;
  }
  return findings;
}

bool healthy(std::span<const Finding> findings) {
  return std::ranges::none_of(findings, [](const Finding& f) { return f.status == FindingStatus::Fail; });
}

std::string findings_text(std::span<const Finding> findings, bool colors) {
  std::size_t width = 0;
  for (const Finding& finding : findings) width = std::max(width, finding.name.size());
  std::string text;
  for (const Finding& finding : findings) {
    const Look look = look_of(finding.status);
    text += fmt::format("{}{:<4}{}  {:<{}}  {}\n", colors ? look.color : "", look.word, colors ? "\x1b[0m" : "",
                        finding.name, width, finding.detail);
    if (!finding.remedy.empty()) text += fmt::format("{:{}}-> {}\n", "", width + 8, finding.remedy);
  }
  return text;
}

std::string findings_json(std::span<const Finding> findings) {
  Json json{{"schema", "hpr.doctor/1"}, {"healthy", healthy(findings)}, {"findings", Json::array()}};
  for (const Finding& finding : findings) {
    json["findings"].push_back({{"name", finding.name},
                                {"status", look_of(finding.status).word},
                                {"detail", finding.detail},
                                {"remedy", finding.remedy}});
  }
  return json.dump(2) + "\n";
}

}  // namespace hpr
