#include "engine/wall/hearing.h"

#include "cluster/transport/collectives.h"

namespace hpr {
namespace {

constexpr char kLine = '+';
constexpr char kNothing = '-';
constexpr char kEnd = '.';

}  // namespace

Heard hear_line(Communicator& comm, LineSource* source, std::chrono::milliseconds longest,
                std::optional<InputLine>& from) {
  std::string said(1, kNothing);
  if (source != nullptr) {
    from = source->next(longest);
    if (from) {
      said = kLine + from->text;
    } else if (source->ended()) {
      said = kEnd;
    }
  }
  said = broadcast_text(comm, said);
  if (said.front() == kLine) return {said.substr(1), false};
  return {std::nullopt, said.front() == kEnd};
}

}  // namespace hpr
