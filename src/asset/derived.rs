//! A value that is derived from a mesh, maps and settings. It is made when it is first needed, and stored with the key
//! that it was made from. One function returns it and compares the keys first, so that nobody has to clear it when an
//! input changes.

use std::sync::{Arc, Weak};

use crate::device::{Booked, Device};
use vrtm_core::error::Result;

/// Something that follows from what its key names.
#[derive(Debug)]
pub(crate) struct Derived<K, T>(Option<Made<K, T>>);

#[derive(Debug)]
struct Made<K, T> {
    key: K,
    value: T,
    /// Dropped after the value.
    booked: Booked,
}

impl<K, T> Default for Derived<K, T> {
    fn default() -> Self {
        Derived(None)
    }
}

impl<K: PartialEq, T> Derived<K, T> {
    /// The value that follows from the key; `make` makes it, and books its bytes, unless it is there. The value of
    /// another key is gone by then.
    pub fn get(
        &mut self,
        device: &Device,
        key: K,
        make: impl FnOnce(&K, &mut Booked) -> Result<T>,
    ) -> Result<&mut T> {
        let made = match self.0.take().filter(|made| made.key == key) {
            Some(made) => made,
            None => {
                let mut booked = device.booking();
                let value = make(&key, &mut booked)?;
                Made { key, value, booked }
            }
        };
        Ok(&mut self.0.insert(made).value)
    }

    /// The value that follows from the key, if it is there.
    pub fn known(&self, key: &K) -> Option<&T> {
        self.0.as_ref().filter(|made| made.key == *key).map(|made| &made.value)
    }

    /// The key and the value of the last one made.
    pub fn last(&self) -> Option<(&K, &T)> {
        self.0.as_ref().map(|made| (&made.key, &made.value))
    }

    pub fn last_mut(&mut self) -> Option<&mut T> {
        self.0.as_mut().map(|made| &mut made.value)
    }

    /// Takes over what was made in another way than by `get`.
    pub fn put(&mut self, key: K, value: T, booked: Booked) {
        self.0 = Some(Made { key, value, booked });
    }

    /// Takes over what was made of the last value, and is as large.
    pub fn follow(&mut self, key: K, value: T) {
        if let Some(made) = &mut self.0 {
            (made.key, made.value) = (key, value);
        }
    }

    /// Books the bytes of the last value, if there is one.
    pub fn book(&mut self, bytes: u64, what: &str) -> Result<()> {
        self.0.as_mut().map_or(Ok(()), |made| made.booked.set(bytes, what))
    }

    pub fn free(&mut self) {
        self.0 = None;
    }

    pub fn bytes(&self) -> u64 {
        self.0.as_ref().map_or(0, |made| made.booked.bytes())
    }
}

/// Names a shared value in a key: equal for the same one. The value itself may be dropped.
#[derive(Clone, Debug)]
pub(crate) struct Same<T>(Weak<T>);

impl<T> Same<T> {
    pub fn of(value: &Arc<T>) -> Same<T> {
        Same(Arc::downgrade(value))
    }
}

impl<T> PartialEq for Same<T> {
    fn eq(&self, other: &Same<T>) -> bool {
        // A `Weak` keeps the address from being used again.
        self.0.ptr_eq(&other.0)
    }
}
