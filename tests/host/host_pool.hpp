/* A host's own threads: a fixed number of them, which take tasks from one queue. It knows nothing of vrtm. */

#ifndef HOST_POOL_HPP
#define HOST_POOL_HPP

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

class HostPool {
public:
    explicit HostPool(int threads)
    {
        for (int i = 0; i < threads; ++i) {
            threads_.emplace_back([this] { work(); });
        }
    }

    /* Runs what is left in the queue. */
    ~HostPool()
    {
        {
            const std::lock_guard<std::mutex> lock(mutex_);
            ended_ = true;
        }
        told_.notify_all();
        for (std::thread &thread : threads_) {
            thread.join();
        }
    }

    void spawn(std::function<void()> task)
    {
        {
            const std::lock_guard<std::mutex> lock(mutex_);
            queue_.push_back(std::move(task));
        }
        told_.notify_one();
    }

    /* As in TBB, the calling thread works, too, and so a loop may be called from within a loop. */
    template <class Body> void parallel_for(std::size_t count, const Body &body)
    {
        struct Loop {
            std::atomic<std::size_t> next{0}, done{0};
        };
        const auto loop = std::make_shared<Loop>();
        /* A helper that comes late finds no index left, and does not touch the body, which may be gone. */
        const auto help = [loop, count, &body] {
            for (std::size_t i = loop->next++; i < count; i = loop->next++) {
                body(i);
                ++loop->done;
            }
        };
        for (std::size_t i = 1; i < count && i <= threads_.size(); ++i) {
            spawn(help);
        }
        help();
        while (loop->done != count) {
            std::this_thread::yield();
        }
    }

private:
    void work()
    {
        std::unique_lock<std::mutex> lock(mutex_);
        for (;;) {
            told_.wait(lock, [this] { return ended_ || !queue_.empty(); });
            if (queue_.empty()) {
                return;
            }
            const std::function<void()> task = std::move(queue_.front());
            queue_.pop_front();
            lock.unlock();
            task();
            lock.lock();
        }
    }

    std::mutex mutex_;
    std::condition_variable told_;
    std::deque<std::function<void()>> queue_;
    bool ended_ = false;
    std::vector<std::thread> threads_;
};

#endif
