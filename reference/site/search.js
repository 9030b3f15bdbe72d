/* Search by section: ranked by how rare the words are and how often they occur for its length (BM25),
   those in headings more, with an excerpt. The texts are in search_text.js, as a browser fetches no page from a disk. */
const inSections = {
  /* Page, heading, anchor and score of the best section of each page that has all words. */
  find: (sections, words) => {
    const has = (text, word) => text.split(word).length - 1;
    const rare = words.map((word) =>
      Math.log(1 + sections.length / (1 + sections.filter((s) => s.lower.includes(word)).length)));
    const mean = sections.reduce((sum, s) => sum + s.lower.length, 0) / sections.length;
    const best = new Map(), found = new Map();
    for (const section of sections) {
      let score = 0;
      const long = 0.3 + 0.9 * section.lower.length / mean;
      const all = found.get(section.page) || new Set();
      words.forEach((word, k) => {
        const often = has(section.lower, word);
        if (often) all.add(word);
        score += rare[k] * (2.2 * often / (often + long) + (section.heading.toLowerCase().includes(word) ? 2 : 0));
        if (!often) score -= 2 * rare[k]; // a section with all words is better
      });
      found.set(section.page, all);
      if (!best.has(section.page) || best.get(section.page).score < score)
        best.set(section.page, { ...section, score });
    }
    return [...best.values()]
      .filter((section) => found.get(section.page).size === words.length)
      .sort((a, b) => b.score - a.score);
  },
};

if (typeof Search !== "undefined") {
  const sections = SEARCH_TEXT.map(([page, title, heading, anchor, text]) =>
    ({ page, title, heading, anchor, text, lower: `${heading} ${text}`.toLowerCase() }));
  Search.performTermsSearch = (words, excluded) => {
    const kept = sections.filter((s) => ![...excluded].some((word) => s.lower.includes(word)));
    const results = inSections.find(kept, [...words].map((word) => word.toLowerCase()));
    return results.map(({ page, title, heading, anchor }, rank) => [
      page,
      heading === title ? title : `${title} > ${heading}`,
      anchor ? `#${anchor}` : "",
      null,
      Scorer.title * (1 - rank / results.length), // not above a title that is the query
      page,
      SearchResultKind.text,
    ]);
  };
  window.fetch = (url) => Promise.resolve({ text: () => Promise.resolve(url) });
  Search.htmlToText = (url, anchor) => {
    const page = url.slice(document.documentElement.dataset.content_root.length)
      .slice(0, -DOCUMENTATION_OPTIONS.FILE_SUFFIX.length);
    const of_page = sections.filter((section) => section.page === page);
    const section = of_page.find((s) => `#${s.anchor}` === anchor) || of_page[0];
    return section ? section.text : "";
  };
}
