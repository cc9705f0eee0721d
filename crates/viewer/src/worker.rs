//! [`Worker`]: a value that is changed by work on another thread.
//!
//! The value is here or, while work is done, away: it moves to a thread and comes back with the result, so nothing is
//! shared and nothing is locked. Without threads, as on a web page, the work is done in place.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// What a thread sends back: the value and the result of its work, or the message of a panic.
type Done<T, R> = (T, Result<R, String>);

/// A value and the thread that works on it.
#[derive(Debug)]
pub(crate) struct Worker<T, R> {
    /// `None` while it is away.
    value: Option<T>,
    done: Option<Receiver<Done<T, R>>>,
}

impl<T: Send + 'static, R: Send + 'static> Worker<T, R> {
    pub(crate) fn new(value: T) -> Self {
        Self {
            value: Some(value),
            done: None,
        }
    }

    /// The value, unless it is away.
    pub(crate) fn here(&self) -> Option<&T> {
        self.value.as_ref()
    }

    /// The value for changes that take no time, unless it is away.
    pub(crate) fn here_mut(&mut self) -> Option<&mut T> {
        self.value.as_mut()
    }

    /// Starts work on the value, unless it is away; `wake` is called when the result can be fetched.
    pub(crate) fn start(
        &mut self,
        work: impl FnOnce(&mut T) -> R + Send + 'static,
        wake: impl FnOnce() + Send + 'static,
    ) {
        let Some(mut value) = self.value.take() else {
            return;
        };
        let (sender, receiver) = channel();
        self.done = Some(receiver);
        let run = move || {
            let result = catch_unwind(AssertUnwindSafe(|| work(&mut value)));
            let result = result.map_err(|panic| message(panic.as_ref()));
            // The receiver is gone if the window was closed or shows another body.
            let _ = sender.send((value, result));
            wake();
        };
        if cfg!(target_family = "wasm") {
            run();
        } else {
            std::thread::spawn(run);
        }
    }

    /// Takes the value back if the work is done; returns its result, or the message of a panic, after which the value may
    /// be in any state.
    pub(crate) fn poll(&mut self) -> Option<Result<R, String>> {
        match self.done.as_ref()?.try_recv() {
            Ok(done) => Some(self.take_back(done)),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                self.done = None;
                Some(Err("its thread has ended".to_owned()))
            }
        }
    }

    /// Waits for the work.
    #[cfg(test)]
    pub(crate) fn wait(&mut self) -> Option<Result<R, String>> {
        let done = self.done.as_ref()?.recv().ok()?;
        Some(self.take_back(done))
    }

    fn take_back(&mut self, (value, result): Done<T, R>) -> Result<R, String> {
        (self.value, self.done) = (Some(value), None);
        result
    }
}

/// The message of a panic.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or(panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("unknown").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_is_away_until_the_work_is_done() {
        let mut worker = Worker::new(1);
        let (go, gate) = channel::<()>();
        let (woken, wakes) = channel();
        let work = move |value: &mut i32| {
            gate.recv().unwrap();
            *value += 1;
            "done"
        };
        worker.start(work, move || woken.send(()).unwrap());
        assert_eq!(worker.here(), None);
        assert_eq!(worker.poll(), None);
        // Work for a value that is away is not done.
        worker.start(
            |value| {
                *value = 9;
                "never"
            },
            || (),
        );
        go.send(()).unwrap();
        wakes.recv().unwrap();
        assert_eq!(worker.poll(), Some(Ok("done")));
        assert_eq!(worker.here(), Some(&2));
        assert_eq!(worker.poll(), None);
    }

    #[test]
    fn a_panic_is_a_message_and_the_value_comes_back() {
        let mut worker = Worker::new(1);
        worker.start(|_| assert_eq!(1, 2, "one is not two"), || ());
        let message = worker.wait().unwrap().unwrap_err();
        assert!(message.contains("one is not two"), "{message}");
        worker.start(|value| *value += 1, || ());
        assert_eq!(worker.wait(), Some(Ok(())));
        assert_eq!(worker.here(), Some(&2));
    }
}
