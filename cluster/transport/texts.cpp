#include "cluster/transport/texts.h"

#include <span>

#include "cluster/transport/collectives.h"

namespace hpr {
namespace {

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::string broadcast_text(Communicator& comm, const std::string& text) {
  const auto own = std::as_bytes(std::span(text));
  std::vector<std::byte> bytes(own.begin(), own.end());
  broadcast(comm, bytes);
  return text_of(bytes);
}

std::vector<std::string> all_gather_texts(Communicator& comm, const std::string& text) {
  std::vector<std::string> texts;
  for (const auto& bytes : all_gather(comm, std::as_bytes(std::span(text)))) texts.push_back(text_of(bytes));
  return texts;
}

}  // namespace hpr
