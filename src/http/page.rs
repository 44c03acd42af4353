//! Lists in pages.

use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use super::extract::FromQuery;
use super::query::Params;

/// Most items of one page.
pub const MAX_PAGE: u32 = 1000;

/// Items of a page where the client does not say.
const DEFAULT_PAGE: u32 = 100;

/// Which page of a list is asked for.
#[derive(Debug, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PageQuery {
    /// Most items to return.
    #[param(minimum = 1, maximum = 1000, default = 100)]
    pub limit: Option<u32>,
    /// `next_cursor` of the page before; the first page where there is none.
    pub cursor: Option<String>,
}

impl FromQuery for PageQuery {
    fn from_query(params: &mut Params) -> PageQuery {
        PageQuery { limit: params.whole("limit", 1, MAX_PAGE), cursor: params.text("cursor") }
    }
}

impl PageQuery {
    /// Most items to return.
    pub fn limit(&self) -> usize {
        self.limit.unwrap_or(DEFAULT_PAGE) as usize
    }
}

/// A page of a list.
#[derive(Debug, Serialize, ToSchema)]
pub struct Page<T> {
    /// The items, in ascending order of their ids.
    pub items: Vec<T>,
    /// Cursor of the next page; `null` after the last.
    pub next_cursor: Option<String>,
}

impl<T> Page<T> {
    /// A page of at most `limit` of the items; there are more where one follows.
    pub fn new(mut items: Vec<T>, limit: usize, id: impl Fn(&T) -> &str) -> Page<T> {
        let more = items.len() > limit;
        items.truncate(limit);
        let next_cursor = items.last().filter(|_| more).map(|last| id(last).to_owned());
        Page { items, next_cursor }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cursor_leads_to_the_next_page_only_where_there_is_one() {
        let ids = || vec!["a".to_owned(), "b".to_owned(), "c".to_owned()];
        let page = Page::new(ids(), 2, |id| id);
        assert_eq!(
            (page.items, page.next_cursor),
            (vec!["a".into(), "b".into()], Some("b".into()))
        );
        assert_eq!(Page::new(ids(), 3, |id| id).next_cursor, None);
    }
}
