//! What the tests that draw share: a watched device. Scenes without a file are in `mesoshell::stress::scenes`, and in `effects`.
#![allow(dead_code, reason = "each test binary uses its own part")]

pub mod effects;

use std::collections::BTreeSet;
use std::sync::Arc;

use mesoshell::frame::Frame;
use mesoshell::gpu::{DeviceChoice, Messages};
use mesoshell::method::{self, Choice, Method, Setup};
use mesoshell::progress::{Interrupt, Progress, Silent};
use mesoshell::scene::{Scene, View};
use serde_json::Value;

/// A method under the eyes of the validation layers, synchronization validation included: any message, the device's
/// end included, fails the test. A test without a Vulkan driver or without the layers fails too, and says what to install.
pub struct Watched {
    method: Option<Box<dyn Method>>,
    messages: Messages,
}

impl Watched {
    pub fn prepare(name: &str, scene: &Arc<Scene>) -> Self {
        let messages = Messages::default();
        let entry = method::by_name(name).expect("a known method");
        let method = set_up(&messages, |setup| entry.prepare(scene.clone(), &setup))
            .unwrap_or_else(|error| panic!("{error}\n{error:?}"));
        Self { method: Some(method), messages }
    }

    pub fn update(&mut self, scene: &Arc<Scene>) {
        let method = self.method.as_mut().expect("present until dropped");
        method.update(scene.clone()).unwrap_or_else(|error| panic!("{error}"));
    }

    pub fn plan(&self) -> Vec<Choice> {
        self.method.as_ref().expect("present until dropped").plan()
    }

    pub fn render(&mut self, view: &View) -> Frame {
        let method = self.method.as_mut().expect("present until dropped");
        method.render(view).unwrap_or_else(|error| panic!("{error}"))
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        self.method = None;
        let messages = self.messages.all();
        if !std::thread::panicking() {
            assert!(messages.is_empty(), "the validation layers said:\n{}", messages.join("\n"));
        }
    }
}

/// Runs something on any device, silently, while the validation layers write down `messages`.
pub fn set_up<T>(messages: &Messages, run: impl FnOnce(Setup<'_>) -> T) -> T {
    let progress: Arc<dyn Progress> = Arc::new(Silent);
    run(Setup {
        device: &DeviceChoice::Any,
        validation: Some(messages),
        progress: &progress,
        interrupt: &Interrupt::default(),
    })
}

/// The keys of all objects in a JSON value.
pub fn keys(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                found.insert(key.clone());
                keys(value, found);
            }
        }
        Value::Array(items) => items.iter().for_each(|item| keys(item, found)),
        _ => {}
    }
}
