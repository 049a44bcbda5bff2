#include "app/report_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "core/text.h"

namespace hpr {
namespace {

/// An error takes three lines, so none of its parts may hold a line break of its own.
std::string one_line(std::string_view text) {
  std::string line(text);
  std::ranges::replace(line, '\n', ' ');
  return printable(line, 2000);
}

}  // namespace

void print_error(const Error& error, std::string_view who) {
  std::string text = fmt::format("hpr: error: {}{}\n", who, one_line(error.what()));
  if (!error.line().empty()) text += fmt::format("  | {}\n", printable(error.line(), 160));
  if (!error.hint().empty()) text += fmt::format("  hint: {}\n", one_line(error.hint()));
  std::fputs(text.c_str(), stderr);
}

}  // namespace hpr
