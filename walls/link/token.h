#pragma once

#include <string>

#include "walls/link/protocol.h"

/// The session token: both ends of a TCP link show that they know it without sending it.
namespace hpr {

/// What a display process and a run compare to know that they are of one build.
[[nodiscard]] std::string link_build();

/// The secret that both ends of a TCP link know: HPR_TOKEN; empty where it is not set.
[[nodiscard]] std::string link_token();

/// Random bytes from the system.
[[nodiscard]] LinkNonce make_nonce();

/// A number no other run has.
[[nodiscard]] std::uint64_t make_session();

/// HMAC-SHA256 under the token of who shows it ("run" or "display"), both nonces and what the run says it is.
[[nodiscard]] LinkProof prove_token(const std::string& token, const std::string& who, const LinkNonce& of_display,
                                    const Hello& hello);

/// Takes equally long whatever differs.
[[nodiscard]] bool same_proof(const LinkProof& a, const LinkProof& b);

}  // namespace hpr
