use vrtm_core::local::{try_with, with};

#[test]
fn each_thread_has_its_own_and_keeps_it() {
    assert!(!with(|local| local.lent.replace(true)));
    std::thread::spawn(|| assert!(!with(|local| local.lent.replace(true)))).join().unwrap();
    assert_eq!(try_with(|local| local.lent.replace(false)), Some(true));
}
