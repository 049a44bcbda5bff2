#include "engine/wall/command_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
CommandTable::CommandTable() {
  add({"help", "[COMMAND]", "what can be said here", [this](Arguments arguments) { return help(arguments); }, true});
}

std::string CommandTable::run(const std::string& line) const {
  const auto words = split_line(line);
  if (!words) refuse("a quote is not closed", "hide \"big chair\"");
  const std::vector<std::string>& arguments = *words;
  if (arguments.empty()) return "";
  const auto found = std::ranges::find(commands_, arguments.front(), &SessionCommand::name);
  if (found != commands_.end()) {
    if (found->usage.empty() && arguments.size() > 1) {
      refuse(fmt::format("'{}' takes nothing", arguments.front()), arguments.front());
    }
    return found->run(Arguments(arguments).subspan(1));
  }
  std::vector<std::string> names;
  for (const SessionCommand& command : commands_) names.push_back(command.name);
  throw Error(ExitCode::Usage, fmt::format("there is no command '{}'", printable(arguments.front())),
              unknown_name_hint(arguments.front(), names));
}

bool CommandTable::only_tells(const std::string& line) const {
  const auto words = split_line(line);
  if (!words || words->empty()) return true;
  const auto found = std::ranges::find(commands_, words->front(), &SessionCommand::name);
  return found == commands_.end() || found->only_tells;
}

std::string CommandTable::help(Arguments arguments) const {
  std::string text;
  for (const SessionCommand& command : commands_) {
    if (!arguments.empty() && command.name != arguments.front()) continue;
    const std::string written = fmt::format("{} {}", command.name, command.usage);
    text += fmt::format("{}{:<44} {}", text.empty() ? "" : "\n", written, command.summary);
  }
  if (text.empty()) refuse(fmt::format("there is no command '{}'", printable(arguments.front())), "help");
  return text;
}

void refuse(const std::string& problem, const std::string& example) {
  throw Error(ExitCode::Usage, problem, "write e.g. " + example);
}

double number_of(const std::string& text) {
  double number = 0.0;
  const char* const last = text.data() + text.size();
  const auto result = std::from_chars(text.data(), last, number);
  if (result.ec != std::errc() || result.ptr != last || !std::isfinite(number)) {
    refuse(fmt::format("'{}' is no finite number", printable(text)), "1.5");
  }
  return number;
}

glm::dvec3 point_of(const std::string& text) {
  glm::dvec3 point{0.0};
  std::istringstream stream(text);
  std::string part;
  int count = 0;
  for (; std::getline(stream, part, ','); ++count) {
    if (count < 3) point[count] = number_of(part);
  }
  if (count != 3 || text.ends_with(',')) {
    refuse(fmt::format("'{}' is not X,Y,Z", printable(text)), "0,1.5,-2");
  }
  return point;
}

glm::dvec3 direction_of(const glm::dvec3& point) {
  const double largest = std::max({std::abs(point.x), std::abs(point.y), std::abs(point.z)});
  if (!(largest > 0.0)) refuse("0,0,0 is no direction", "0,1,0");
  return glm::normalize(point / largest);
}

}  // namespace hpr
