//! report.html: report.md as one file that needs no other, its plots inline and its tables sorted by a click.

use std::collections::BTreeMap;

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd, html::push_html};

/// The page around the text: `{style}`, `{title}` and `{text}` stand for the report's.
const PAGE: &str = include_str!("report.html");
/// How the project's pages look; the page of `compare` has it too.
const STYLE: &str = include_str!("page.css");

/// The page of a report. Links in `markdown` whose address is a key of `svgs` become those drawings.
pub fn page(title: &str, markdown: &str, svgs: &BTreeMap<String, String>) -> String {
    let mut within_link = false;
    let events =
        Parser::new_ext(markdown, Options::ENABLE_TABLES).filter_map(|event| match event {
            Event::Start(Tag::Link { ref dest_url, .. }) => match svgs.get(&**dest_url) {
                Some(svg) => {
                    within_link = true;
                    Some(Event::InlineHtml(svg.clone().into()))
                }
                None => Some(event),
            },
            Event::End(TagEnd::Link) if within_link => {
                within_link = false;
                None
            }
            // The picture that stands for it.
            _ if within_link => None,
            // Names of scenes and adapters come from outside: what looks like HTML in them is text.
            Event::Html(text) | Event::InlineHtml(text) => Some(Event::Text(text)),
            event => Some(event),
        });
    let mut text = String::new();
    push_html(&mut text, events);
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    // The text last: what is in it is not looked through.
    PAGE.replacen("{style}", STYLE, 1)
        .replacen("{title}", &title, 1)
        .replacen("{text}", &text, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plots_are_drawn_in_place_and_foreign_markup_is_text() {
        let svgs = BTreeMap::from([("a.svg".to_owned(), "<svg>drawn</svg>".to_owned())]);
        let markdown = "# <b>x</b>\n\n[![a](a.png)](a.svg)\n\n![b](b)\n\n| ms |\n|---|\n| <script>no()</script> 1 |\n";
        let page = page("t <i>", markdown, &svgs);
        assert!(page.contains("<title>t &lt;i></title>"), "{page}");
        assert!(page.contains("<p><svg>drawn</svg></p>"), "{page}");
        assert!(page.contains("&lt;b&gt;x"), "{page}");
        assert!(
            page.contains("<td>&lt;script&gt;no()&lt;/script&gt; 1</td>"),
            "{page}"
        );
        assert!(
            page.contains("<img src=\"b\""),
            "only what is known is drawn"
        );
        assert_eq!(page.matches("<script>").count(), 1);
    }
}
