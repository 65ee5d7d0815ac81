// A neighbour that wants what the cloth wants: one thread on another core that streams memory and multiplies without
// pause.
#ifndef DCLOTH_TOOLS_CONTEND_H_
#define DCLOTH_TOOLS_CONTEND_H_

#include <atomic>
#include <thread>

namespace dcloth::tools {

class Contender {
 public:
  explicit Contender(int core);  // starts and waits until it runs
  ~Contender();                  // stops and joins
  Contender(const Contender&) = delete;
  Contender& operator=(const Contender&) = delete;

 private:
  std::atomic<bool> stop_{false};
  std::atomic<bool> running_{false};
  std::thread thread_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CONTEND_H_
