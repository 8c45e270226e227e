// Starts the viewer of a page that has nothing else.

runPage([], pageData());
