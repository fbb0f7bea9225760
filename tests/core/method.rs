mod acceptance;
mod pbd;
